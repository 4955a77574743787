import { FormatError, SourceError } from "@meshreel/player-core/errors";
import { MODES, type Mode } from "@meshreel/player-three/modes";
import { describe, expect, test } from "vitest";
import * as parse from "../src/attributes.ts";
import { layersChoices, layersValue, modeChoices, nextMode, speedChoices } from "../src/controls/choices.ts";
import { chosenFile } from "../src/drop.ts";
import { formatAmount, formatRate, formatSpeed, formatTime, recordingName, speakTime, timeDigits } from "../src/format.ts";
import { actionOf, KEYS, seekStep, takesKey } from "../src/keyboard.ts";
import { explain } from "../src/messages.ts";
import { readParameters, readTime } from "../src/parameters.ts";
import { ranges } from "../src/ranges.ts";
import { SectionKeeper } from "../src/section.ts";
import { GraphicsError } from "../src/stage.ts";
import { statisticsLines } from "../src/stats.ts";
import { stoodUp, turnOf } from "@meshreel/player-three/upright";
import { goesOn } from "../src/view.ts";
import { FakePlayback, INFO } from "./fake.ts";

describe("standing upright", () => {
  const box = { minimum: [-1, 2, 5], size: [3, 4, 6] } as const;
  test("what is up in a file is up in the picture, and the box goes along", () => {
    const boxes = ["y", "-y", "z", "-z", 7, undefined].map((up) => stoodUp(box, turnOf({ up })));
    expect(boxes[0]).toEqual(box);
    expect(boxes[1]).toEqual({ minimum: [-1, -6, -11], size: [3, 4, 6] }); // x, -y, -z
    expect(boxes[2]).toEqual({ minimum: [-1, 5, -6], size: [3, 6, 4] }); // x, z, -y
    expect(boxes[3]).toEqual({ minimum: [-1, -11, 2], size: [3, 6, 4] }); // x, -z, y
    expect(boxes.slice(4)).toEqual([box, box]);
  });
  test("no other word is taken for an axis", () => {
    expect(["constructor", "x", "toString"].map((up) => turnOf({ up }))).toEqual([0, 0, 0]);
  });
  test("an axis that is given counts, whatever the file tells", () => {
    expect((["z", "-y", null] as const).map((given) => turnOf({ up: "-z" }, given))).toEqual([-Math.PI / 2, Math.PI, Math.PI / 2]);
  });
});

describe("a section", () => {
  /** Where a player of 2 s, of which .5 to 1.5 is the section, is after each of these times; a seek led to those below 0. */
  const kept = (direction: "normal" | "reverse", times: readonly number[], section: readonly [number, number] = [0.5, 1.5]): number[] => {
    const keeper = new SectionKeeper();
    return times.map((time, k) => {
      if (time < 0) keeper.forget();
      const player = { section: k === 0 ? ([0.5, 1.5] as const) : section, duration: 2, paused: false, ended: false, seeking: false, direction, currentTime: Math.abs(time), play: () => Promise.resolve() };
      keeper.keep(player);
      return player.currentTime;
    });
  };
  test("goes back to its start where its end is passed, however far, and past the end of the recording", () => {
    expect(kept("normal", [1, 1.4, 1.6, 0.6, 0.1])).toEqual([1, 1.4, 0.5, 0.6, 0.5]);
    expect(kept("reverse", [1, 0.6, 0.4, 1.4, 1.9])).toEqual([1, 0.6, 1.5, 1.4, 1.5]);
  });
  test("is come to from before, also after a seek out of it", () => {
    expect(kept("normal", [0.1, 0.4, 1, -0.2, 0.2, 0.3])).toEqual([0.1, 0.4, 1, 0.2, 0.2, 0.3]);
    expect(kept("reverse", [1.9, 1.6, 1, -1.8, 1.8, 1.7])).toEqual([1.9, 1.6, 1, 1.8, 1.8, 1.7]);
  });
  test("is come to where another one is set", () => {
    expect(kept("normal", [1, 1.1, 1.7, 2], [1.6, 1.9])).toEqual([1, 1.1, 1.7, 1.6]);
  });
});

describe("attributes", () => {
  test("a speed is held between 0.1 and 4, and is 1 where it is no number", () => {
    expect(["0.5", "9", "-2", "fast", "", null, "NaN", "Infinity"].map(parse.parseSpeed)).toEqual([0.5, 4, 0.1, 1, 1, 1, 1, 1]);
  });
  test("layers are a whole number from 0, else auto", () => {
    expect(["0", " 3 ", "auto", "-1", "1.5", "", null].map(parse.parseLayers)).toEqual([0, 3, "auto", "auto", "auto", "auto", "auto"]);
  });
  test("a mode that is not known, or that the recording has not, is its splats, its colours, or shaded", () => {
    const texts = ["normal", "WIREFRAME", "splats", "color", "colour", "x", null];
    const read = (hasColors: boolean, hasSplats: boolean): Mode[] => texts.map((text) => parse.parseMode(text, { hasColors, hasSplats }));
    expect(read(true, true)).toEqual(["normal", "wireframe", "splats", "color", "color", "splats", "splats"]);
    expect(read(false, true)).toEqual(["normal", "wireframe", "splats", "shaded", "shaded", "splats", "splats"]);
    expect(read(true, false)).toEqual(["normal", "wireframe", "color", "color", "color", "color", "color"]);
    expect(read(false, false)).toEqual(["normal", "wireframe", "shaded", "shaded", "shaded", "shaded", "shaded"]);
    expect(parse.parseMode("tracks", null)).toBe("tracks");
    expect(texts.map(parse.wantsSplats)).toEqual([false, false, true, false, false, true, true]);
  });
  test("an axis that points up is one of four, or nobody's word", () => {
    expect(["y", "Z", " -y ", "-z", "x", "", null].map(parse.parseUp)).toEqual(["y", "z", "-y", "-z", null, null, null]);
  });
  test("a value that is none is told with what would be one", () => {
    for (const [name, good, bad] of [
      ["camera", ["0,1,3,0,1,0", " 1e-3, -2,3,4,5,6 ", ""], ["1,2,3", "1,,3,4,5,6", "a,b,c,d,e,f", "1,2,3,4,5,Infinity"]],
      ["mode", ["normal", "WIREFRAME", "color", " "], ["x", "shaded,normal"]],
      ["layers", ["auto", "Auto", " 3 ", "0", ""], ["high", "-1", "1.5", "NaN"]],
      ["speed", ["1", " .5 ", "-2", "9", ""], ["fast", "NaN", "Infinity", "2x"]],
      ["playbackrate", ["1"], ["fast"]],
      ["interpolate", ["on", "off", "No", "0", "true", ""], ["maybe", "2"]],
      ["theme", ["auto", "Dark", "light", ""], ["pink", "constructor"]],
      ["up", ["y", "-Z", ""], ["x", "up"]],
    ] as const) {
      expect(good.filter((text) => parse.complaint(name, text) !== null)).toEqual([]);
      expect(bad.filter((text) => parse.complaint(name, text) === null)).toEqual([]);
    }
    expect(["", "0", "2.5", "-1", "x"].map(parse.parseExposure)).toEqual([1, 0, 2.5, 1, 1]);
    expect(parse.complaint("exposure", "-1")).toBe('exposure "-1" is ignored: give a number from 0');
    expect(parse.complaint("layers", "high")).toBe('layers "high" is ignored: give auto, or a whole number of layers from 0');
    expect(parse.complaint("poster", "high")).toBeNull();
  });
  test("interpolation is on unless it is switched off", () => {
    expect([null, "", "on", "off", "false", "0"].map(parse.parseSwitch)).toEqual([true, true, true, false, false, false]);
  });
  test("a flag that says false is off, as those who write it mean", () => {
    expect([null, "", "loop", "false"].map(parse.parseFlag)).toEqual([false, true, true, false]);
  });
  test("a theme is light, dark or the system's", () => {
    expect(["light", "Dark", "pink", null].map(parse.parseTheme)).toEqual(["light", "dark", "auto", "auto"]);
  });
});

describe("numbers as text", () => {
  test("times have minutes, hours where needed, and tenths where wanted", () => {
    expect([0, 9.99, 65, 3600 + 125].map((seconds) => formatTime(seconds))).toEqual(["0:00", "0:09", "1:05", "1:02:05"]);
    expect([0, 3.25, 59.99].map((seconds) => formatTime(seconds, 1))).toEqual(["0:00.0", "0:03.2", "0:59.9"]);
    expect([0, 3.25, 59.999, 61.5].map((seconds) => formatTime(seconds, 2))).toEqual(["0:00.00", "0:03.25", "0:59.99", "1:01.50"]);
  });
  test("a time just below a tenth by rounding is that tenth", () => {
    expect(formatTime(0.1 + 0.2 - 4e-17, 1)).toBe("0:00.3");
    expect(formatTime(7 / 10 - 1e-12, 1)).toBe("0:00.7");
  });
  test("each frame of a short recording has its own time", () => {
    for (const rate of [5, 10, 12, 24, 30, 60, 100]) {
      const texts = Array.from({ length: 2 * rate }, (_, frame) => formatTime(frame / rate, timeDigits(2, rate)));
      expect(new Set(texts).size, `${rate} fps`).toBe(texts.length);
    }
    expect([timeDigits(2, 10), timeDigits(2, 30), timeDigits(60, 30), timeDigits(NaN, 0)]).toEqual([1, 2, 0, 0]);
  });
  test("times that are none are zero", () => {
    expect([NaN, -3, Infinity].map((seconds) => formatTime(seconds))).toEqual(["0:00", "0:00", "0:00"]);
  });
  test("times are spoken with units", () => {
    expect([0, 1, 61.5, 120].map(speakTime)).toEqual(["0 seconds", "1 second", "1 minute 1.5 seconds", "2 minutes 0 seconds"]);
  });
  test("amounts have three digits and a power of 1000", () => {
    expect([0, 999, 1000, 12_340, 999_600, 1.5e9].map((value) => formatAmount(value, "B"))).toEqual([
      "0 B", "999 B", "1.00 kB", "12.3 kB", "1.00 MB", "1.50 GB",
    ]);
    expect(formatRate(2.414)).toBe("2.41 Mbit/s");
  });
  test("a recording's name is the last of its address without its ending", () => {
    expect(["https://a.b/c/walk%20one.reel?x=1#t", "", "https://a.b/%ZZ.reel"].map(recordingName)).toEqual(["walk one", "meshreel", "%ZZ"]);
    expect(formatSpeed(0.25)).toBe("0.25×");
  });
});

describe("keys", () => {
  test("each key of the help overlay has its action, in upper case too", () => {
    for (const [name, action] of KEYS.flatMap(({ keys }) => Object.entries(keys))) {
      const shiftKey = name.startsWith("Shift+");
      const key = name.replace("Shift+", "");
      expect(actionOf({ key, shiftKey })).toBe(action);
      if (key.length === 1) expect(actionOf({ key: key.toUpperCase(), shiftKey: true })).toBe(action);
      else expect(actionOf({ key, shiftKey: !shiftKey })).not.toBe(action);
    }
  });
  test("keys with Ctrl, Alt or Meta belong to the browser", () => {
    for (const modifier of ["ctrlKey", "altKey", "metaKey"]) expect(actionOf({ key: "f", [modifier]: true })).toBeNull();
    expect(actionOf({ key: "q" })).toBeNull();
  });
  test("a form field keeps its keys, a button its Space, the seek bar none", () => {
    expect(takesKey({ localName: "input", type: "text" }, "k")).toBe(true);
    expect(takesKey({ localName: "input", type: "range" }, "ArrowLeft")).toBe(false);
    expect(takesKey({ localName: "textarea" }, "f")).toBe(true);
    expect(takesKey({ localName: "select" }, "ArrowDown")).toBe(true);
    expect(takesKey({ localName: "div", isContentEditable: true }, "f")).toBe(true);
    expect([" ", "k"].map((key) => takesKey({ localName: "button" }, key))).toEqual([true, false]);
    expect(takesKey({ localName: "div" }, " ")).toBe(false);
  });
  test("an arrow seeks a tenth of a short recording and five seconds of a long one", () => {
    expect([2, 600].map(seekStep)).toEqual([0.2, 5]);
  });
});

describe("menus", () => {
  test("a speed that is none of the usual stands among them", () => {
    expect(speedChoices(1).map(({ value }) => value)).not.toContain("0.6");
    expect(speedChoices(0.6).map(({ value }) => value).slice(2, 5)).toEqual(["0.5", "0.6", "0.75"]);
  });
  test("numbers of layers go from full to lowest below auto", () => {
    const choices = layersChoices(INFO.mostLayers, "auto");
    expect(choices.map(({ value }) => value)).toEqual(["auto", "3", "2", "1", "0"]);
    expect(choices.map(({ text }) => text)).toEqual(["Auto", "Highest", "2 of 3 layers", "1 of 3 layers", "Lowest"]);
  });
  test("of many numbers of layers some are offered, and always the one that is set", () => {
    const values = layersChoices(40, 7).map(({ value }) => value);
    expect(values).toHaveLength(8);
    expect(values).toContain("7");
    expect(values.slice(0, 2)).toEqual(["auto", "40"]);
    expect(values.at(-1)).toBe("0");
  });
  test("more layers than the richest group has are those of the richest", () => {
    expect(layersValue(3, 9)).toBe("3");
    expect(layersValue(3, "auto")).toBe("auto");
    expect(layersChoices(0, 9).map(({ value }) => value)).toEqual(["auto", "0"]);
  });
  test.each([
    [{ hasColors: true, hasSplats: true }, [...MODES]],
    [{ hasColors: true, hasSplats: false }, MODES.slice(1)],
    [{ hasColors: false, hasSplats: true }, MODES.filter((mode) => mode !== "color")],
    [{ hasColors: false, hasSplats: false }, MODES.slice(2)],
  ])("the next mode of the last is the first; colours and splats are offered where there are some", (has, wanted) => {
    const all = modeChoices(has).map(({ value }) => value);
    expect(all).toEqual(wanted);
    let mode = all[0] as Mode;
    for (const expected of [...all.slice(1), all[0]]) expect((mode = nextMode(mode, has))).toBe(expected);
  });
});

describe("messages", () => {
  test("errors are told in plain words with the exact ones below", () => {
    const message = explain(new SourceError("http://x/a.reel: not found (404), check the address", { kind: "missing" }));
    expect(message).toMatchObject({ title: "The recording was not found", retry: true, detail: expect.stringContaining("404") });
  });
  test("each kind of failure has its own words, and only a newer file cannot be tried again", () => {
    const sources = (["missing", "refused", "failing", "unreachable", "foreign", "unusable"] as const).map((kind) => new SourceError("x", { kind }));
    const formats = (["damaged", "newer"] as const).map((kind) => new FormatError("x", kind));
    const errors = [...sources, ...formats, new GraphicsError("x"), new Error("x")];
    expect(new Set(errors.map((error) => explain(error).title)).size).toBe(errors.length);
    expect(errors.filter((error) => !explain(error).retry)).toEqual([formats[1]]);
    expect(explain(new FormatError("x", "foreign")).title).toBe(explain(new SourceError("x", { kind: "foreign" })).title);
  });
});

describe("drawing only what changed", () => {
  const shown = { frame: 3, blend: 0.5, frames: [3], groups: [null], background: null, images: [null], backgroundImage: null };
  test("a paused playback that has shown something needs no pictures", () => {
    const playback = new FakePlayback("x", { layers: "auto", interpolate: true, textures: true, splats: true, loop: false, direction: "normal", playbackRate: 1, muted: false, volume: 1, crossOrigin: null });
    expect(goesOn(playback, null)).toBe(true);
    expect(goesOn(playback, shown)).toBe(false);
    playback.seeking = true;
    expect(goesOn(playback, shown)).toBe(true);
    playback.seeking = playback.paused = false;
    expect(goesOn(playback, shown)).toBe(true);
    playback.info = { ...INFO, frameCount: 0 };
    expect(goesOn(playback, null)).toBe(false);
    playback.dispose();
  });
});

describe("small parts", () => {
  test("of dropped files the first .reel is taken", () => {
    expect(chosenFile([{ name: "a.txt" }, { name: "b.REEL" }])?.name).toBe("b.REEL");
    expect(chosenFile([{ name: "a.txt" }])?.name).toBe("a.txt");
    expect(chosenFile([])).toBeUndefined();
  });
  test("ranges are as those of a media element", () => {
    const span = ranges(1, 2);
    expect([span.length, span.start(0), span.end(0)]).toEqual([1, 1, 2]);
    expect(() => span.start(1)).toThrow(/range 1 of 1/);
    expect([ranges(2, 2).length, ranges(0, NaN).length]).toEqual([0, 0]);
  });
  test("the statistics name what the overlay must show", () => {
    const playback = new FakePlayback("x", { layers: "auto", interpolate: true, textures: true, splats: true, loop: false, direction: "normal", playbackRate: 1, muted: false, volume: 1, crossOrigin: null });
    const lines = statisticsLines({ ...playback.stats, triangles: 41_234, gpuBytes: 12_345_678, splats: 0, sortMs: 0, headsetRate: 0, fps: 60, frameMs: 0.42, drawn: 1 }, INFO, 4);
    expect(Object.fromEntries(lines)).toMatchObject({
      Frame: "5 of 48, 24 fps", Bitrate: "2.41 Mbit/s", "Connection speed": "48.2 Mbit/s", Triangles: "41,234", "GPU memory": "12.3 MB", Layers: "3 of 3",
      "Skipped groups": "0", Colours: "none", Display: "60 fps, 0.4 ms each",
    });
    playback.dispose();
  });
});

describe("the layers in the overlay", () => {
  test.each([
    [3, 3, 3, "3 of 3"], [1, 3, 3, "1 of 3"], [0, 0, 3, "3 of 3"], [2, 2, 3, "3 of 3"], [1, 2, 3, "1 of 2"], [0, 0, 0, "one only"],
  ])("%i layers of the %i there are, of %i in the file: %s", (layers, wholeLayers, mostLayers, text) => {
    const playback = new FakePlayback("x", { layers: "auto", interpolate: true, textures: true, splats: true, loop: false, direction: "normal", playbackRate: 1, muted: false, volume: 1, crossOrigin: null });
    const numbers = { ...playback.stats, layers, wholeLayers, triangles: 0, gpuBytes: 0, splats: 0, sortMs: 0, headsetRate: 0, fps: 0, frameMs: 0, drawn: 0 };
    expect(Object.fromEntries(statisticsLines(numbers, { ...INFO, mostLayers }, 0)).Layers).toBe(text);
    playback.dispose();
  });
});

describe("the address of the page", () => {
  test("parameters are attributes; flags that say no take them away", () => {
    const { attributes, time, bench } = readParameters("?src=a%20b.reel&loop&autoplay=1&controls=0&mode=normal&layers=2&evil=1&speed=&t=1:05.5&bench");
    expect([...attributes]).toEqual([
      ["src", "a b.reel"], ["mode", "normal"], ["layers", "2"], ["autoplay", ""], ["loop", ""], ["controls", null],
    ]);
    expect([time, bench]).toEqual([65.5, 20]);
  });
  test("a bench takes as many seconds as it is asked for, else twenty; none where the address says no", () => {
    expect(["?bench=5", "?bench=x", "?bench=0", ""].map((search) => readParameters(search).bench)).toEqual([5, 20, null, null]);
  });
  test("a time that is none is the start", () => {
    expect(["", "12.5", "2s", "1:00:01", "-4", "1e9", "x", null].map(readTime)).toEqual([0, 12.5, 2, 3601, 0, 0, 0, 0]);
  });
});
