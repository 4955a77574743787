// A panel at the left wrist: the time, and what the controller's buttons do.

import { CanvasTexture, Mesh, MeshBasicMaterial, PlaneGeometry, SRGBColorSpace } from "three";

const [WIDTH, HEIGHT] = [512, 360]; // pixels
const WIDE = 0.16; // m
const EVERY = 250; // ms between two looks at the time
const LINE = 44; // pixels
const MARGIN = 24; // pixels
const HINTS = [["Trigger", "play, pause"], ["Stick ← →", "step; hold to seek"], ["Stick ↑", "go there"], ["Stick click", "bring it here"], ["Grip", "move; both: scale"]] as const;

export class Panel extends Mesh<PlaneGeometry, MeshBasicMaterial> {
  readonly #context: CanvasRenderingContext2D;
  readonly #texture: CanvasTexture;
  #looked = -Infinity; // ms
  #shown = "";

  constructor() {
    const canvas = Object.assign(document.createElement("canvas"), { width: WIDTH, height: HEIGHT });
    const texture = new CanvasTexture(canvas);
    texture.colorSpace = SRGBColorSpace;
    super(new PlaneGeometry(WIDE, (WIDE * HEIGHT) / WIDTH), new MeshBasicMaterial({ map: texture }));
    this.#texture = texture;
    this.#context = canvas.getContext("2d")!;
    this.position.set(0, 0.09, 0.02); // above the hand
    this.rotation.x = -Math.PI / 5; // towards the face
  }

  /** Once a picture, with milliseconds; `time` tells seconds, and of how many. */
  update(now: number, time: () => readonly [number, number]): void {
    if (this.parent === null || now - this.#looked < EVERY) return;
    this.#looked = now;
    const [seconds, duration] = time();
    const text = `${seconds.toFixed(1)} / ${duration.toFixed(1)} s`;
    if (text === this.#shown) return;
    this.#shown = text;
    this.#draw(text, duration > 0 ? seconds / duration : 0);
    this.#texture.needsUpdate = true;
  }

  override dispose(): void {
    super.dispose();
    this.removeFromParent();
    this.geometry.dispose();
    this.material.dispose();
    this.#texture.dispose();
  }

  #draw(text: string, share: number): void {
    const context = this.#context;
    const bar = WIDTH - 2 * MARGIN;
    context.fillStyle = "#14171c";
    context.fillRect(0, 0, WIDTH, HEIGHT);
    context.font = "28px system-ui, sans-serif";
    [[text, ""], ...HINTS].forEach(([left, right], line) => {
      const y = MARGIN + 28 + LINE * line + (line > 0 ? LINE : 0);
      context.fillStyle = line > 0 ? "#b4bcc6" : "#f4f6f8";
      context.fillText(left, MARGIN, y);
      context.fillStyle = "#f4f6f8";
      context.fillText(right, WIDTH / 3 + MARGIN, y);
    });
    context.fillStyle = "#454a52";
    context.fillRect(MARGIN, MARGIN + LINE, bar, 12);
    context.fillStyle = "#5ab0ff";
    context.fillRect(MARGIN, MARGIN + LINE, bar * share, 12);
  }
}
