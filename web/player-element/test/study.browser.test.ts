// Studies in the built player: participants' ways through them, and the files of answers that they leave.

import { copyFileSync, readFileSync } from "node:fs";
import { join } from "node:path";
import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { describeInBrowser } from "../../test/browser.ts";
import { ROOT } from "../../test/python.ts";
import { HEAD } from "../src/study/table.ts";
import { Site } from "./product.ts";

type Row = Readonly<Record<string, string>>;

describeInBrowser("a study", () => {
  const site = new Site();
  beforeAll(async () => {
    await site.open();
    copyFileSync(join(ROOT, "src/meshreel/server/sample.reel"), join(site.folder, "sample.reel"));
    site.write("slow.network.csv", "seconds,mbps\n0,0.25\n");
    site.write("fast.network.csv", "seconds,mbps\n0,20\n");
  }, 120_000);
  afterAll(() => site.close());

  /** Opens a study as a participant and starts it. */
  async function begin(name: string, description: object | string, participant = "P 1"): Promise<{ page: Page; errors: string[] }> {
    site.write(name, typeof description === "string" ? description : JSON.stringify(description));
    const visited = await site.visit(`player/index.html?study=/${name}${participant === "" ? "" : `&participant=${encodeURIComponent(participant)}`}`);
    await visited.page.setViewportSize({ width: 1000, height: 640 });
    return visited;
  }

  const start = (page: Page) => page.getByRole("button", { name: "Start" }).click();
  const choose = (page: Page, name: string) => page.getByRole("button", { name }).click({ timeout: 60_000 }); // once it is enabled

  /** Saves the answers at the end: the name of the file, and its rows. */
  async function saved(page: Page): Promise<{ name: string; rows: Row[] }> {
    const [download] = await Promise.all([page.waitForEvent("download"), choose(page, "Save answers")]);
    const [head, ...rows] = readFileSync(await download.path(), "utf8").trimEnd().split("\r\n").map((line) => line.split(","));
    expect(head).toEqual(HEAD);
    return { name: download.suggestedFilename(), rows: rows.map((row) => Object.fromEntries(row.map((value, k) => [head![k]!, value]))) };
  }

  test("shows pairs side by side, and gives a CSV of choices, replays and of what came", async () => {
    const pairs = [
      { name: "one", a: "layers.reel", b: "mixed.reel" },
      { name: "two", a: "scene.reel", b: "laplacian.reel", network: "fast.network.csv" },
    ];
    const { page, errors } = await begin("beside.study.json", { name: "Tiny files", seed: 4, network: "slow.network.csv", camera: [[0, 0, 1, 4, 0, 0.5, 0], [0.2, 3, 1, 3, 0, 0.5, 0]], pairs });
    await page.getByRole("heading", { name: "Tiny files" }).waitFor();
    await start(page);
    const better = page.getByRole("button", { name: "A looks better" });
    expect(await better.isDisabled()).toBe(true); // until both were seen
    await page.getByRole("button", { name: "Watch again" }).click({ timeout: 60_000 });
    await choose(page, "A looks better");
    await page.getByText("Pair 2 of 2").waitFor();
    await choose(page, "No difference");
    const { name, rows } = await saved(page);
    expect(name).toBe("Tiny-files-P-1.csv");
    expect(rows.map(({ trial }) => trial)).toEqual(["1", "2"]);
    expect(new Set(rows.map(({ pair }) => pair))).toEqual(new Set(["one", "two"]));
    expect(new Set(rows.map(({ first }) => first))).toEqual(new Set(["a", "b"])); // in half of the trials each
    expect(rows.map(({ choice }) => choice)).toEqual([rows[0]!.first, "none"]);
    expect(rows.map(({ replays }) => replays)).toEqual(["1", "0"]);
    for (const row of rows) {
      expect(row).toMatchObject({ study: "Tiny files", seed: "4", participant: "P 1", show: "beside", hidden: "0" });
      const own = pairs.find((pair) => pair.name === row.pair)!;
      expect([row.a, row.b, row.network]).toEqual([own.a, own.b, own.network ?? "slow.network.csv"].map((file) => site.served.url + file));
      for (const file of ["a", "b"] as const) {
        expect(Number(row[`${file}_bytes`])).toBe(readFileSync(join(site.folder, own[file])).length); // all of so small a file comes with its head
        expect(Number(row[`${file}_start_s`])).toBeGreaterThan(0.04); // an answer takes as long
        expect(row[`${file}_layers_by_group`]).toMatch(/^[\d: |]+$/);
      }
      expect(Number(row.seconds)).toBeGreaterThan(0);
      expect(Math.abs(Date.parse(row.answered!) - Date.now())).toBeLessThan(600_000);
    }
    expect(errors).toEqual([]);
    await page.close();
  });

  test("shows a pair one after the other, to a participant who writes a name", async () => {
    const { page, errors } = await begin("turn.study.json", { name: "In turn", show: "in turn", question: "Which is smoother?", pairs: [{ a: "layers.reel", b: "mixed.reel" }] }, "");
    await start(page);
    expect(await page.getByRole("button", { name: "Start" }).isVisible()).toBe(true); // without a name it stays
    await page.getByLabel("Participant").fill("Ada, =1");
    await start(page);
    expect(await page.getByRole("button", { name: "Start" }).isVisible()).toBe(true);
    await page.getByLabel("Participant").fill("Ada");
    const seen = page.evaluate(() => new Promise<string[]>((done) => {
      const names: string[] = [];
      const look = (): void => {
        const shown = [...document.querySelectorAll<HTMLElement>(".pane")].filter((pane) => !pane.hidden && pane.querySelector<HTMLElement>(".cover")!.hidden).map((pane) => pane.innerText.trim());
        if (shown.length > 0 && names.at(-1) !== shown.join()) names.push(shown.join());
        if (document.querySelector<HTMLButtonElement>(".choices button:enabled")) done(names);
        else requestAnimationFrame(look);
      };
      look();
    }));
    await start(page);
    await page.getByRole("heading", { name: "Which is smoother?" }).waitFor();
    expect(await seen).toEqual(["A", "B"]);
    await choose(page, "B looks better");
    const { rows } = await saved(page);
    expect(rows).toHaveLength(1);
    expect(rows[0]).toMatchObject({ participant: "Ada", show: "in turn", choice: rows[0]!.first === "a" ? "b" : "a", network: "" });
    expect(errors).toEqual([]);
    await page.close();
  });

  test("delivers the same layers, as often as one likes, and fewer where the network gives less", async () => {
    const taken = async (network: string): Promise<Row> => {
      const { page, errors } = await begin(`${network}.study.json`, { name: "Sample", network, show: "in turn", pairs: [{ a: "sample.reel", b: "layers.reel" }] });
      await start(page);
      await choose(page, "No difference");
      const { rows } = await saved(page);
      expect(errors).toEqual([]);
      await page.close();
      return rows[0]!;
    };
    const [slow, again, fast] = [await taken("slow.network.csv"), await taken("slow.network.csv"), await taken("fast.network.csv")];
    const groups = ({ a_layers_by_group: text }: Row): Record<string, string> =>
      Object.fromEntries(text!.split(" | ").flatMap((body, k) => body.split(" ").map((group) => [`${k} ${group.split(":")[0]}`, group.split(":")[1]!])));
    const [before, after] = [groups(slow), groups(again)];
    const both = Object.keys(before).filter((group) => group in after); // a busy machine may draw no picture of a group
    expect(both.length).toBeGreaterThan(3);
    for (const group of both) expect(after[group], group).toBe(before[group]);
    expect(Number(slow.a_layers)).toBeLessThan(Number(fast.a_layers));
    expect(Number(slow.a_start_s)).toBeGreaterThan(Number(fast.a_start_s));
    expect(Number(slow.a_stalled_s)).toBeGreaterThan(Number(fast.a_stalled_s));
  });

  test.each([
    ["{", "is no JSON"],
    [JSON.stringify({ name: "x", pairs: [{ a: "layers.reel", c: "mixed.reel" }] }), 'pairs[0]: "c" is given, but the keys are name, a, b, network, camera, layers'],
    [JSON.stringify({ name: "x", network: "none.csv", pairs: [{ a: "layers.reel", b: "mixed.reel" }] }), "none.csv: the server answers 404; check the address"],
    [JSON.stringify({ name: "x", network: "bad.study.json", pairs: [{ a: "layers.reel", b: "mixed.reel" }] }), "a network trace begins with seconds,mbps"],
  ])("that says %s says what is wrong", async (text, message) => {
    const { page } = await begin("bad.study.json", text);
    await page.getByRole("heading", { name: "The study cannot go on" }).waitFor();
    expect(await page.locator("pre").innerText()).toContain(message);
    await page.close();
  });

  test("keeps the answers where a later file cannot be played", async () => {
    site.write("broken.reel", readFileSync(join(site.folder, "layers.reel")).subarray(0, 300));
    const { page } = await begin("broken.study.json", { name: "Broken", order: "given", pairs: [{ a: "layers.reel", b: "mixed.reel" }, { a: "layers.reel", b: "broken.reel" }] });
    await start(page);
    await choose(page, "No difference");
    await page.getByRole("heading", { name: "The study cannot go on" }).waitFor({ timeout: 60_000 });
    expect(await page.locator("pre").innerText()).toMatch(new RegExp(`^${site.served.url}broken.reel: \\d+ of its groups are damaged, copy the file again$`));
    expect((await saved(page)).rows).toMatchObject([{ pair: "1", choice: "none" }]);
    await page.close();
  });
});
