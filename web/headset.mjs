// Plays a recording on the page of ?bench in a browser that is slowed down, and writes what it took as JSON:
// `node headset.mjs ADDRESS SECONDS THROTTLE RATE`. Pictures are asked for RATE times a second.
import { chromium } from "playwright-core";

const [address, ...numbers] = process.argv.slice(2);
const [seconds, throttle, rate] = numbers.map(Number);
const SIZE = { width: 320, height: 240 }; // pixels: few, as they are drawn by software, which a headset's are not
const POLLING = 100; // ms; by pictures, which are what is measured, it would disturb them
const PATIENCE = 300_000; // ms for the whole: some of what is asked of a page has no limit of its own

/** In the page: a display of `rate` pictures a second in the place of the browser's, and a meter of JavaScript and uploads. */
function install(rate) {
  const waiting = new Map();
  let [handles, last] = [0, 0];
  const meter = { since: 0, pictures: [], uploaded: 0, drawn: 0 };
  const tick = () => {
    const [start, callbacks] = [performance.now(), [...waiting.values()]];
    waiting.clear();
    for (const callback of callbacks) callback((1000 * last) / rate);
    meter.pictures.push(performance.now() - start);
  };
  window.requestAnimationFrame = (callback) => {
    if (waiting.size === 0) {
      last = Math.max(last, Math.floor((performance.now() * rate) / 1000)) + 1;
      setTimeout(tick, (1000 * last) / rate - performance.now());
    }
    waiting.set(++handles, callback);
    return handles;
  };
  window.cancelAnimationFrame = (handle) => waiting.delete(handle);
  for (const name of ["bufferData", "bufferSubData", "texImage2D", "texSubImage2D", "texImage3D", "texSubImage3D"]) {
    const own = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...given) {
      for (const each of given) meter.uploaded += ArrayBuffer.isView(each) ? each.byteLength : 0;
      return own.apply(this, given);
    };
  }
  const drawn = () => document.querySelector("meshreel-player").statistics.drawn;
  window.restartMeter = () => Object.assign(meter, { since: performance.now(), pictures: [], uploaded: 0, drawn: drawn() });
  window.readMeter = () => {
    const { pictures, uploaded } = meter;
    return { seconds: (performance.now() - meter.since) / 1000, pictures, uploaded, drawn: drawn() - meter.drawn };
  };
}

/** Before the worker's script: answers wait until so many times of what they took has passed. DevTools slow down pages alone. */
function slowAnswers(throttle) {
  const { buffer } = new WebAssembly.Memory({ initial: 1, maximum: 1, shared: true }); // pages without isolation have no other
  const [cell, post] = [new Int32Array(buffer), self.postMessage.bind(self)];
  let began = 0;
  self.addEventListener("message", () => (began = performance.now()));
  self.postMessage = (message, transfer) => {
    Atomics.wait(cell, 0, 0, (throttle - 1) * (performance.now() - began));
    began = performance.now(); // what comes next without a message of its own has not taken this
    message.ms *= throttle;
    if (message.packed) message.packed.decodeMs *= throttle;
    post(message, transfer);
  };
}

setTimeout(() => {
  console.error(`${address} is not played within ${PATIENCE / 1000} s`);
  process.exit(1); // and the browser with it
}, PATIENCE).unref();
const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]; // drawn by software: the same on every machine
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args });
const page = await browser.newPage({ viewport: SIZE });
await page.addInitScript(install, rate);
await page.route("**/worker.js", async (route) => {
  const response = await route.fetch();
  await route.fulfill({ response, body: `(${slowAnswers})(${throttle});\n${await response.text()}` });
});
const tools = await page.context().newCDPSession(page);
await tools.send("Emulation.setCPUThrottlingRate", { rate: throttle });
await page.goto(`${address}&autoplay=0&bench=${seconds}`);
const wait = (test) => page.waitForFunction(test, undefined, { polling: POLLING, timeout: 0 });
await wait(() => document.querySelector("meshreel-player")?.paused === false);
await page.evaluate(() => restartMeter());
await page.waitForTimeout(1000 * seconds);
const meter = await page.evaluate(() => readMeter());
const { usedSize, backingStorageSize } = await tools.send("Runtime.getHeapUsage");
const report = await wait(() => document.querySelector("pre")?.textContent.split("\n").find((line) => line.startsWith("{")));
console.log(JSON.stringify({ ...meter, heap: usedSize + (backingStorageSize ?? 0), report: JSON.parse(await report.jsonValue()) }));
await browser.close();
