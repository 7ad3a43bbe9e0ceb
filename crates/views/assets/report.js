"use strict";
// Draws the figures of a report: each is {data, layout} for the plotting library.

const BASE = {
  paper_bgcolor: "#fff", plot_bgcolor: "#fff", hovermode: "closest",
  font: { family: "system-ui, 'Segoe UI', Roboto, sans-serif", size: 12.5, color: "#3a3f48" },
  margin: { l: 58, r: 14, t: 14, b: 46 },
  // Readings are small points in a map, and large enough to be told apart beside their names.
  legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 12 }, itemsizing: "constant" },
};
const AXIS = { gridcolor: "#eceef1", zeroline: false, linecolor: "#9aa0ab", showline: true, ticks: "outside", tickcolor: "#9aa0ab", automargin: true };

PLOTS.forEach((plot, index) => {
  const layout = { ...BASE, ...plot.layout };
  for (const key of Object.keys(plot.layout)) {
    if (/^[xy]axis/.test(key)) layout[key] = { ...AXIS, ...plot.layout[key] };
  }
  if (plot.layout.margin) layout.margin = { ...BASE.margin, ...plot.layout.margin };
  Plotly.newPlot("plot-" + (index + 1), plot.data, layout,
    { responsive: true, displayModeBar: false });
});
