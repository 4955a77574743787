// Draws the posters of the gallery: the first picture of each tile in view, one after the other, in one hidden player. Plays what is pointed at, searches, sorts.

const player = document.createElement("meshreel-player");
player.className = "painter";
document.body.append(player);

/** Draws one poster; a file that cannot be played keeps its plain tile. */
async function draw(image) {
  await customElements.whenDefined("meshreel-player");
  const drawn = new Promise((done, fail) => {
    player.addEventListener("canplay", done, { once: true });
    player.addEventListener("error", fail, { once: true });
  });
  player.src = image.dataset.file;
  await drawn;
  image.src = URL.createObjectURL(await player.screenshot());
}

let last = Promise.resolve();
const seen = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (!isIntersecting) continue;
    seen.unobserve(target);
    last = last.then(() => draw(target)).catch(() => {});
  }
});
for (const image of document.querySelectorAll("img[data-file]")) seen.observe(image);

/** Plays the recording of a tile in the place of its poster while a mouse points at it. */
const preview = document.createElement("meshreel-player");
preview.className = "preview";
for (const name of ["muted", "loop", "autoplay"]) preview.setAttribute(name, "");
const list = document.querySelector("ul");
const still = matchMedia("(prefers-reduced-motion: reduce)");
for (const image of document.querySelectorAll("img[data-file]")) {
  const tile = image.closest("li");
  tile.addEventListener("pointerenter", ({ pointerType }) => {
    if (pointerType !== "mouse" || still.matches) return;
    preview.src = image.dataset.file;
    preview.poster = image.src;
    image.after(preview);
  });
  tile.addEventListener("pointerleave", () => preview.remove());
}

const tiles = [...list.children];
document.querySelector("input").addEventListener("input", ({ target }) => {
  const words = target.value.toLowerCase().split(/\s+/);
  for (const tile of tiles) tile.hidden = !words.every((word) => tile.querySelector(".name").textContent.toLowerCase().includes(word));
});
document.querySelector("select").addEventListener("change", ({ target }) => {
  const { value } = target;
  const most = (tile) => Number(tile.dataset[value]); // names are sorted already
  list.append(...(value === "name" ? tiles : [...tiles].sort((one, other) => most(other) - most(one))));
});
