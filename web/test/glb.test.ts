// Compressed GLB files of `meshreel export --compress` show in three.js what plain ones do.

import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { execFileSync } from "node:child_process";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { AnimationMixer, Mesh, Vector3, type Object3D } from "three";
import { GLTFLoader, type GLTF } from "three/addons/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
import { describe, expect, test } from "vitest";
import { hasPython, PYTHON, ROOT, runModule } from "./python.ts";

const NAMES = ["layers", "mixed", "scene", "layers_patched", "colored/vertices"];

function canRun(): boolean {
  try {
    execFileSync(PYTHON, ["-c", "import meshoptimizer"], { stdio: "ignore" });
    return true;
  } catch {
    return false;
  }
}

async function load(path: string): Promise<GLTF> {
  const bytes = readFileSync(path);
  return new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), "");
}

/** What is seen at a time, by the names of shapes: the corners and the middles of triangles, and the scale of the shape's node. */
function seen({ scene, animations }: GLTF, time: number): Map<string, { points: Vector3[]; scale: number }> {
  const mixer = new AnimationMixer(scene);
  for (const clip of animations) mixer.clipAction(clip).play();
  mixer.setTime(time);
  scene.updateMatrixWorld(true);
  const found = new Map<string, { points: Vector3[]; scale: number }>();
  scene.traverse((object: Object3D) => {
    if (!(object instanceof Mesh) || object.scale.x === 0) return;
    const index = object.geometry.index!;
    const corners = Array.from({ length: index.count }, (_, k) => object.getVertexPosition(index.getX(k), new Vector3()).applyMatrix4(object.matrixWorld) as Vector3);
    const points = corners.flatMap((corner, k) => (k % 3 < 2 ? [corner] : [corner, corner.clone().add(corners[k - 1]!).add(corners[k - 2]!).divideScalar(3)]));
    found.set(object.name, { points, scale: object.scale.x });
  });
  return found;
}

const farthest = (from: Vector3[], to: Vector3[]): number => Math.max(...from.map((a) => Math.min(...to.map((b) => a.distanceTo(b)))));

const ready = hasPython && canRun();

describe(`compressed GLB${ready ? "" : " (skipped: no meshoptimizer in .venv)"}`, () => {
  test.skipIf(!ready).each(NAMES)("%s is read by three.js, and its surfaces are where the plain file has them", async (name) => {
    const folder = mkdtempSync(join(tmpdir(), "meshreel-glb-"));
    try {
      const paths = ["plain.glb", "small.glb"].map((file) => join(folder, file));
      runModule("meshreel", "export", join(ROOT, `conformance/v1/${name}.reel`), "-o", paths[0]!);
      runModule("meshreel", "export", join(ROOT, `conformance/v1/${name}.reel`), "-o", paths[1]!, "--compress");
      const [plain, small] = await Promise.all(paths.map(load));
      const required = small!.parser.json.extensionsRequired as string[];
      expect(required).toEqual(["EXT_meshopt_compression", "KHR_mesh_quantization"]);
      let count = 0;
      for (const time of [0.001, 0.05, 0.17, 0.3]) {
        const [wanted, got] = [seen(plain!, time), seen(small!, time)];
        expect([...got.keys()]).toEqual([...wanted.keys()]);
        for (const [shape, { points, scale }] of got) {
          const exact = wanted.get(shape)!.points;
          const step = 0.5 * Math.sqrt(3) * scale + 1e-6; // half of one an axis, and what float32 costs
          expect(points.length).toBe(exact.length);
          expect(farthest(points, exact)).toBeLessThan(step);
          expect(farthest(exact, points)).toBeLessThan(step);
          count += points.length;
        }
      }
      expect(count).toBeGreaterThan(0);
    } finally {
      rmSync(folder, { recursive: true, force: true });
    }
  });
});
