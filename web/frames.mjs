// Writes what the player shows of a recording, a PNG a frame: `node frames.mjs ADDRESS FOLDER WIDTH HEIGHT FRAME...`.
import { writeFileSync } from "node:fs";
import { chromium } from "playwright-core";

const [address, folder, width, height, ...frames] = process.argv.slice(2);
const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]; // drawn by software: the same on every machine
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args });
const page = await browser.newPage({ viewport: { width: Number(width), height: Number(height) } });
await page.goto(address);
await page.waitForFunction(() => document.querySelector("meshreel-player").readyState >= 2);
for (const frame of frames) {
  const picture = await page.evaluate(async (wanted) => {
    const player = document.querySelector("meshreel-player");
    const arrived = new Promise((done) => player.addEventListener("seeked", done, { once: true }));
    player.currentTime = (wanted + 0.5) / player.info.frameRate;
    await arrived;
    while (player.statistics.backgroundLate) await new Promise((done) => setTimeout(done, 20));
    const reader = new FileReader();
    const read = new Promise((done) => reader.addEventListener("load", done));
    reader.readAsDataURL(await player.screenshot());
    await read;
    return reader.result;
  }, Number(frame));
  writeFileSync(`${folder}/${frame}.png`, Buffer.from(picture.slice(picture.indexOf(",") + 1), "base64"));
}
console.log(await page.evaluate(() => JSON.stringify(document.querySelector("meshreel-player").statistics)));
await browser.close();
