// Python as it is installed beside the sources, for tests that compare the player with it.

import { execFileSync } from "node:child_process";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

export const ROOT = fileURLToPath(new URL("../../", import.meta.url));
export const PYTHON = join(ROOT, process.platform === "win32" ? ".venv/Scripts/python.exe" : ".venv/bin/python");

/** Whether scripts/setup has made an environment. */
export const hasPython = existsSync(PYTHON);

/** What a module of the sources writes to its standard output. Error where it fails. */
export function runModule(name: string, ...values: readonly (string | number)[]): Buffer {
  return execFileSync(PYTHON, ["-m", name, ...values.map(String)], { cwd: ROOT, maxBuffer: 1 << 26 });
}

/** What a script writes to its standard output. Error where it fails. */
export function runPython(script: URL, ...values: readonly (string | number)[]): Buffer {
  return execFileSync(PYTHON, [fileURLToPath(script), ...values.map(String)], { maxBuffer: 1 << 26 });
}
