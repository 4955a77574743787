// Draws the posters of the gallery: the first picture of each tile in view, one after the other, in one hidden player.

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
