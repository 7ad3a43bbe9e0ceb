// Draws the figures of a report into their places.

import { saveLink, showFigure } from "./chart_pointer.js";

const FIGURES = JSON.parse(document.getElementById("figures").textContent);
const report = document.title.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "");

for (const [k, figure] of FIGURES.entries()) {
  const host = document.getElementById(`figure-${k + 1}`), caption = host.parentElement.querySelector("figcaption");
  host.dataset.words = caption.textContent;
  showFigure(host, figure);
  caption.append(" ", saveLink(host, `${report || "plumage"}-figure-${k + 1}`));
}
