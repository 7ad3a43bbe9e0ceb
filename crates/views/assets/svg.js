// Pieces of SVG: elements as text, the width of words, marks and their styles.

export const INK = "#16181d", TEXT = "#3a3f48", FRAME = "#9aa0ab", GRID = "#eceef1";
export const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";
/** Size of letters and distance of lines, px. */
export const LETTER = 12, LINE = 16;
export const DASHES = { solid: "", dotted: "1.5 3", dashed: "6 4", mixed: "7 3 1.5 3" };

const measure = document.createElement("canvas").getContext("2d");

/** Width of a text, px. */
export function widthOf(text, bold) {
  measure.font = `${bold ? 600 : 400} ${LETTER}px ${FONT}`;
  return measure.measureText(text).width;
}

export const escaped = text => String(text).replace(/[&<>"]/g, c => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

/** An element as text; attributes that are null are left out. */
export function tag(name, attributes, inside = "") {
  const all = Object.entries(attributes).filter(([, v]) => v != null && v !== "");
  return `<${name}${all.map(([k, v]) => ` ${k}="${escaped(v)}"`).join("")}>${inside}</${name}>`;
}

export const write = (text, x, y, more = {}) => tag("text", { x: px(x), y: px(y), fill: TEXT, ...more }, escaped(text));
export const px = v => Number(v.toFixed(1));
export const group = (attributes, parts) => tag("g", attributes, parts.join(""));

/** Text in lines no wider than `width`, px; a word that is wider stands alone. */
export function wrapped(text, width, bold) {
  const lines = [];
  for (const word of text.split(" ")) {
    const longer = lines.length ? `${lines[lines.length - 1]} ${word}` : word;
    if (lines.length && widthOf(longer, bold) <= width) lines[lines.length - 1] = longer; else lines.push(word);
  }
  return lines;
}

/** A mark about the origin of a path, `size` wide. */
export const MARKS = {
  dot: (x, y, s) => `M${px(x)} ${px(y)}h0`,
  diamond: (x, y, s) => `M${px(x)} ${px(y - 0.75 * s)}l${px(.75 * s)} ${px(.75 * s)} ${px(-.75 * s)} ${px(.75 * s)} ${px(-.75 * s)} ${px(-.75 * s)}z`,
  square: (x, y, s) => `M${px(x - s / 2)} ${px(y - s / 2)}h${px(s)}v${px(s)}h${px(-s)}z`,
  ring: (x, y, s) => `M${px(x - s / 2)} ${px(y)}a${px(s / 2)} ${px(s / 2)} 0 1 0 ${px(s)} 0a${px(s / 2)} ${px(s / 2)} 0 1 0 ${px(-s)} 0z`,
  cross: (x, y, s) => `M${px(x - s / 2)} ${px(y)}h${px(s)}M${px(x)} ${px(y - s / 2)}v${px(s)}`,
  bar: (x, y, s) => `M${px(x)} ${px(y - s / 2)}v${px(s)}`,
};

/** Attributes of the path of marks: dots are the round ends of strokes without length, so that thousands are one path. */
export function markStyle(symbol, size, colour) {
  if (symbol === "dot") return { stroke: colour, "stroke-width": px(size), "stroke-linecap": "round", fill: "none" };
  if (symbol === "ring" || symbol === "cross" || symbol === "bar") return { stroke: colour, "stroke-width": 2.2, fill: "none" };
  return { fill: colour };
}
