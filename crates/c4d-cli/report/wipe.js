// The divider of every pair of pictures: a slider, and dragging on a picture.
"use strict";
const root = document.documentElement;
const divider = document.getElementById("divider");

function wipeTo(percent) {
  const at = Math.min(100, Math.max(0, percent));
  root.style.setProperty("--wipe", at + "%");
  if (divider) divider.value = at;
}

if (divider) divider.addEventListener("input", () => wipeTo(Number(divider.value)));
for (const picture of document.querySelectorAll(".wipe")) {
  const follow = (event) => {
    if (event.type === "pointermove" && event.buttons === 0) return;
    const box = picture.getBoundingClientRect();
    wipeTo((100 * (event.clientX - box.left)) / box.width);
    event.preventDefault();
  };
  picture.addEventListener("pointerdown", follow);
  picture.addEventListener("pointermove", follow);
}
// `page.html#25` opens with the divider at a quarter.
const requested = Number.parseFloat(location.hash.slice(1));
if (Number.isFinite(requested)) wipeTo(requested);
