// A grid of numbers as shade and contour lines, for the map, the section and the figures of reports alike.

/** The shade of the plume as red, green, blue and cover of a value above background: `darkest` is nearly the darkest. */
export const plumeShade = darkest => excess => [47, 111, 159, 165 * (1 - Math.exp(-4.4 * Math.max(0, excess) / darkest))];

/** Paints `values` of a grid, a pixel a cell, its first row at the foot; `shade` gives the colour of a value. */
export function paintGrid(canvas, grid, values, shade) {
  canvas.width = grid.columns; canvas.height = grid.rows;
  const paint = canvas.getContext("2d"), image = paint.createImageData(grid.columns, grid.rows);
  for (let r = 0; r < grid.rows; r++) for (let c = 0; c < grid.columns; c++) {
    image.data.set(shade(values[r * grid.columns + c], r, c), 4 * ((grid.rows - 1 - r) * grid.columns + c));
  }
  paint.putImageData(image, 0, 0);
  return canvas;
}

/** Contour lines of one value by marching squares: lists of [column, row], each a whole line. */
export function contourLines(grid, values, level) {
  // Through a cell of which a corner is not known goes no line.
  const at = (c, r) => (values[r * grid.columns + c] ?? NaN) - level, cut = (a, b) => a / (a - b);
  // The crossing of an edge of the grid, and the crossings that it is joined to: one in each cell beside the edge.
  const crossings = new Map();
  const join = ([a, p], [b, q]) => {
    for (const [edge, place, to] of [[a, p, b], [b, q, a]]) {
      if (!crossings.has(edge)) crossings.set(edge, { place, joined: [] });
      crossings.get(edge).joined.push(to);
    }
  };
  for (let r = 0; r + 1 < grid.rows; r++) for (let c = 0; c + 1 < grid.columns; c++) {
    const sw = at(c, r), se = at(c + 1, r), ne = at(c + 1, r + 1), nw = at(c, r + 1), ends = [];
    if (Number.isNaN(sw + se + ne + nw)) continue;
    const across = (c, r) => 2 * (r * grid.columns + c), up = (c, r) => across(c, r) + 1;
    if (sw < 0 !== se < 0) ends.push([across(c, r), [c + cut(sw, se), r]]);
    if (se < 0 !== ne < 0) ends.push([up(c + 1, r), [c + 1, r + cut(se, ne)]]);
    if (nw < 0 !== ne < 0) ends.push([across(c, r + 1), [c + cut(nw, ne), r + 1]]);
    if (sw < 0 !== nw < 0) ends.push([up(c, r), [c, r + cut(sw, nw)]]);
    for (let i = 0; i + 1 < ends.length; i += 2) join(ends[i], ends[i + 1]);
  }
  return chains(crossings);
}

/** Lines through all crossings: first those with ends, then closed ones. */
function chains(crossings) {
  const lines = [], done = new Set();
  const follow = edge => {
    const line = [];
    for (let next = edge; next !== undefined;) {
      done.add(next);
      const { place, joined } = crossings.get(next);
      line.push(place);
      next = joined.find(to => !done.has(to));
      if (next === undefined && line.length > 2 && joined.includes(edge)) line.push(line[0]);
    }
    lines.push(line);
  };
  for (const [edge, { joined }] of crossings) if (joined.length === 1 && !done.has(edge)) follow(edge);
  for (const edge of crossings.keys()) if (!done.has(edge)) follow(edge);
  return lines;
}
