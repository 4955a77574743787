// Files that are dropped on the player.

export interface DropActs {
  welcome(): boolean; // true if files are taken at the moment
  open(file: File): void;
  over(inside: boolean): void; // a file hangs over the player, or no longer
}

/** Takes files that are dropped on `target`. Ends with `signal`. */
export function acceptDrops(target: HTMLElement, { welcome, open, over }: DropActs, signal: AbortSignal): void {
  let depth = 0; // enter and leave come for each node inside
  const leave = () => {
    depth = 0;
    over(false);
  };
  const on = (type: "dragenter" | "dragover" | "dragleave" | "drop", act: (event: DragEvent) => void) =>
    target.addEventListener(type, (event) => { if (welcome() && hasFiles(event)) act(event); }, { signal });
  on("dragenter", (event) => {
    event.preventDefault();
    if (depth++ === 0) over(true);
  });
  on("dragover", (event) => {
    event.preventDefault();
    event.dataTransfer!.dropEffect = "copy";
  });
  on("dragleave", () => { if (--depth <= 0) leave(); });
  on("drop", (event) => {
    event.preventDefault();
    leave();
    const file = chosenFile([...event.dataTransfer!.files]);
    if (file) open(file);
  });
}

function hasFiles(event: DragEvent): boolean {
  return event.dataTransfer?.types.includes("Files") ?? false;
}

/** The first .reel of several files; else the first, whose error then names what it is. */
export function chosenFile<F extends { readonly name: string }>(files: readonly F[]): F | undefined {
  return files.find((file) => file.name.toLowerCase().endsWith(".reel")) ?? files[0];
}
