// ?study: shows a participant pairs of recordings under one network trace and camera path, asks which looks better, and saves the answers as a CSV.

import { readTrace, type Trace } from "@meshreel/player-core/net/trace";
import { make, setText } from "./controls/dom.ts";
import type { MeshreelPlayer } from "./element.ts";
import { readStudy, type File, type Study } from "./study/description.ts";
import { type Film, Pane, StudyEngine } from "./study/pane.ts";
import type { Result } from "./study/showing.ts";
import { STYLES } from "./study/styles.ts";
import { asCsv, type Answer } from "./study/table.ts";
import { trialsOf, type Trial } from "./study/trials.ts";

const NAMES = ["A", "B"] as const; // of the panes
const PARTICIPANT = /^[\p{L}\p{N}][\p{L}\p{N} ._-]{0,63}$/u;
const WANTED = "letters, digits, spaces, dots, dashes and underscores, 64 at most, the first a letter or a digit";

/** Runs the study of an address in the page, from its welcome to the answers. `participant` is empty where the viewer is to write it. */
export async function runStudy(element: typeof MeshreelPlayer, address: string, participant: string): Promise<void> {
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(STYLES);
  document.adoptedStyleSheets = [...document.adoptedStyleSheets, sheet];
  const answers: Answer[] = [];
  const leaving = new AbortController();
  const saved = (): void => leaving.abort();
  addEventListener("beforeunload", (event) => answers.length > 0 && event.preventDefault(), { signal: leaving.signal });
  try {
    const whole = new URL(address, location.href).href;
    const study = readStudy(new TextDecoder().decode(await fetched(whole)), whole);
    document.title = study.name;
    const networks = new Set(study.pairs.flatMap(({ network }) => network ?? []));
    const traces = new Map<string, Trace>();
    for (const network of networks) traces.set(network, readTrace(new TextDecoder().decode(await fetched(network)), network));
    const name = await welcome(study, participant);
    const engine = (element.engine = new StudyEngine(element.engine));
    await new Trials(study, traces, engine, answers, name).run();
    end(study, name, answers, saved);
  } catch (error) {
    fail(error as Error, answers, saved);
  }
}

/** A file's bytes. Error with the address where they do not come. */
async function fetched(address: string): Promise<Uint8Array<ArrayBuffer>> {
  let answer: Response;
  try {
    answer = await fetch(address, { cache: "no-cache" });
  } catch (error) {
    throw new Error(`${address}: no answer; check the address, and that its server allows this page (CORS)`, { cause: error });
  }
  if (!answer.ok) throw new Error(`${address}: the server answers ${answer.status}; check the address`);
  return new Uint8Array(await answer.arrayBuffer());
}

function show(kind: string, ...children: readonly (Node | string)[]): void {
  document.body.replaceChildren(make("main", { class: `study ${kind}` }, ...children));
}

/** What is to be done, and who does it: resolves with the participant's name once that is begun. */
async function welcome({ name, instructions, show: how, pairs }: Study, participant: string): Promise<string> {
  if (participant !== "" && !PARTICIPANT.test(participant)) throw new Error(`participant=${participant} in the address: a participant has ${WANTED}`);
  const count = pairs.length === 1 ? "one pair" : `${pairs.length} pairs`;
  const order = how === "beside" ? "side by side" : "one after the other";
  const input = make("input", { name: "participant", required: "", maxlength: "64", autocomplete: "off", value: participant, title: WANTED });
  const form = make("form", {}, make("label", {}, "Participant, as the organisers named you", input), make("button", { class: "main" }, "Start"));
  if (participant !== "") input.readOnly = true;
  input.addEventListener("input", () => input.setCustomValidity(PARTICIPANT.test(input.value.trim()) ? "" : `Write ${WANTED}.`));
  const usual = [
    `You will see ${count} of moving 3D recordings, A and B, ${order}. Watch both to the end, then say which one looks better to you, or that you see no difference.`,
    "You may watch a pair again before you answer. There is no right answer: your impression counts.",
  ];
  const text = instructions === "" ? usual : [instructions];
  show("", make("div", { class: "card" },
    make("h1", {}, name), ...text.map((line) => make("p", {}, line)), form,
    make("p", { class: "quiet" }, "Nothing is sent anywhere. At the end you save a file with your answers and give it to the organisers. Keep this page in front while it plays."),
  ));
  (participant === "" ? input : form.querySelector("button")!).focus();
  return new Promise((done) => {
    form.addEventListener("submit", (event) => {
      event.preventDefault(); // the page's policy lets no form be sent
      done(input.value.trim());
    });
  });
}

/** The trials of a participant, one after the other. */
class Trials {
  readonly #study: Study;
  readonly #traces: ReadonlyMap<string, Trace>;
  readonly #answers: Answer[];
  readonly #participant: string;
  readonly #panes: readonly Pane[];
  readonly #status = make("p", { role: "status" });
  readonly #count = make("span", { class: "quiet" });
  readonly #progress = make("progress", { "aria-hidden": "true" });
  readonly #choices = ["A looks better", "No difference", "B looks better"].map((text) => make("button", { type: "button", class: "main" }, text));
  readonly #again = make("button", { type: "button", class: "again" }, "Watch again");
  #files = new Map<string, Promise<Uint8Array<ArrayBuffer>>>(); // of this trial and the last
  #hidden = 0;

  constructor(study: Study, traces: ReadonlyMap<string, Trace>, engine: StudyEngine, answers: Answer[], participant: string) {
    this.#study = study;
    this.#traces = traces;
    this.#answers = answers;
    this.#participant = participant;
    this.#panes = NAMES.map((name) => new Pane(name, engine));
    document.addEventListener("visibilitychange", () => void (this.#hidden += Number(document.hidden)));
  }

  async run(): Promise<void> {
    const header = make("header", {}, make("h1", {}, this.#study.question), make("div", {}, this.#count, this.#progress));
    const footer = make("footer", {}, this.#status, make("div", { class: "choices" }, ...this.#choices, this.#again));
    show("trial", header, make("div", { class: "panes" }, ...this.#panes.map(({ element }) => element)), footer);
    const trials = trialsOf(this.#study, this.#participant);
    this.#progress.max = trials.length;
    for (const [k, trial] of trials.entries()) {
      this.#progress.value = k;
      setText(this.#count, `Pair ${k + 1} of ${trials.length}`);
      const films = await this.#load(trial);
      if (k === 0) await Promise.all(this.#panes.map((pane, side) => pane.warm(films[side]!)));
      this.#answers.push(await this.#ask(trial, films, k + 1));
    }
  }

  /** The films of a trial, whole: from here on no network has a part in it. */
  async #load({ pair, first }: Trial): Promise<Film[]> {
    this.#allow(false, "Loading ...");
    for (const pane of this.#panes) pane.cover("");
    const before = this.#files;
    this.#files = new Map([pair.a, pair.b].map((address) => [address, before.get(address) ?? fetched(address)]));
    await Promise.all(this.#files.values());
    const trace = pair.network === null ? null : this.#traces.get(pair.network)!;
    const addresses = first === "a" ? [pair.a, pair.b] : [pair.b, pair.a];
    return Promise.all(addresses.map(async (address) => ({ address, bytes: await this.#files.get(address)!, trace, pair })));
  }

  /** Shows a pair until it is answered. */
  async #ask({ pair, first }: Trial, films: readonly Film[], trial: number): Promise<Answer> {
    const { name: study, seed, show } = this.#study;
    const answered = new AbortController();
    this.#hidden = 0;
    this.#allow(false, "Watch both to the end.");
    const [one, other] = await this.#play(films, answered.signal);
    const { clientWidth: width, clientHeight: height } = this.#panes.at(-1)!.player;
    const ended = performance.now();
    let replays = 0;
    let playing = Promise.resolve();
    const failing = new Promise<never>((_, reject) => {
      this.#again.onclick = () => {
        replays++;
        this.#allow(true, "Watch them again, or choose at any time.");
        this.#again.disabled = true;
        playing = this.#play(films, answered.signal).then(() => !answered.signal.aborted && this.#allow(true, "Choose, or watch them again."), reject) as Promise<void>;
      };
    });
    const chosen = new Promise<number>((done) => this.#choices.forEach((button, k) => (button.onclick = () => done(k))));
    this.#allow(true, "Choose, or watch them again.");
    const choice = await Promise.race([chosen, failing]);
    const seconds = ((performance.now() - ended) / 1000).toFixed(3);
    this.#allow(false, "");
    answered.abort();
    await playing;
    const second: File = first === "a" ? "b" : "a";
    return {
      study, seed, participant: this.#participant, trial, pair: pair.name, a: pair.a, b: pair.b, network: pair.network ?? "", show, first,
      choice: choice === 1 ? "none" : choice === 0 ? first : second, seconds, replays, hidden: this.#hidden, width, height, answered: new Date().toISOString(),
      results: { [first]: one!, [second]: other! } as Record<File, Result>,
    };
  }

  /** Plays both once, each under a trace of its own that begins when it is opened. */
  async #play(films: readonly Film[], signal: AbortSignal): Promise<Result[]> {
    if (this.#study.show === "beside") return Promise.all(this.#panes.map((pane, side) => pane.play(films[side]!, signal)));
    const results: Result[] = [];
    for (const [side, pane] of this.#panes.entries()) {
      if (signal.aborted) return results;
      this.#turnTo(side);
      results.push(await pane.play(films[side]!, signal));
    }
    return results;
  }

  #turnTo(side: number): void {
    this.#panes.forEach(({ element }, k) => (element.hidden = k !== side));
  }

  #allow(isAllowed: boolean, text: string): void {
    for (const button of [...this.#choices, this.#again]) button.disabled = !isAllowed;
    setText(this.#status, text);
  }
}

function saveButton(answers: readonly Answer[], name: string, saved: () => void): HTMLButtonElement {
  const button = make("button", { type: "button", class: "main" }, "Save answers");
  button.addEventListener("click", () => {
    const address = URL.createObjectURL(new Blob([asCsv(answers)], { type: "text/csv" }));
    make("a", { href: address, download: `${name}.csv` }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60_000);
    saved();
  });
  return button;
}

function end({ name }: Study, participant: string, answers: readonly Answer[], saved: () => void): void {
  const file = `${name}-${participant}`.replaceAll(/[^\p{L}\p{N}._-]+/gu, "-");
  const button = saveButton(answers, file, saved);
  const text = `That was the last pair. Save your ${answers.length === 1 ? "answer" : `${answers.length} answers`} as ${file}.csv and give that file to the organisers.`;
  show("", make("div", { class: "card" }, make("h1", {}, "Thank you!"), make("p", {}, text), button));
  button.focus();
}

/** What went wrong, in the words of the error; answers that were given before can be saved. */
function fail(error: Error, answers: readonly Answer[], saved: () => void): void {
  const saving = answers.length === 0 ? [] : [saveButton(answers, "answers-until-the-error", saved)];
  const card = make("div", { class: "card", role: "alert" }, make("h1", {}, "The study cannot go on"), make("p", {}, "Please show this to the organisers:"), make("pre", {}, error.message), ...saving);
  show("", card);
}
