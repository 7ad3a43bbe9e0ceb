// Scales of axes: where a value is in pixels, which values have ticks, and how a number is written.

/** The least of 1, 2 and 5 times a power of ten that is not below `atLeast`. */
export function niceStep(atLeast) {
  const ten = 10 ** Math.floor(Math.log10(Math.max(atLeast, 1e-12)));
  return [1, 2, 5, 10].map(k => k * ten).find(s => s >= atLeast * (1 - 1e-9)) || 10 * ten;
}

/** The next half of a power of ten that is not below a positive value: the steps in which colours follow readings. */
export function upTo(value) {
  const step = 0.5 * 10 ** Math.floor(Math.log10(Math.max(value, 1e-12)));
  return Math.ceil(value / step) * step;
}

/** A value and its standard deviation, both to the second digit of the latter, as formats::number has them. */
export function valueAndSd(value, sd) {
  if (!Number.isFinite(value) || !(sd > 0 && sd < Infinity)) return [numberText(value, 3), numberText(sd, 3)];
  const power = Number(sd.toExponential(1).split("e")[1]) - 1, unit = 10 ** Math.max(0, power);
  const text = v => (Math.round(v / unit) * unit).toFixed(0), fraction = v => v.toFixed(Math.min(12, -power));
  // What rounds to nothing has no sign.
  return [value, sd].map(power < 0 ? fraction : text).map(t => written(t.replace(/^-(?=[0.]*$)/, "")));
}

export const plusMinus = (value, sd) => valueAndSd(value, sd).join(" ± ");

const SUPERSCRIPT = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

/** A number as people write it: with a minus sign, and with a power of ten where it would have too many digits. */
function written(text) {
  const [digits, power] = text.split("e");
  const tens = power ? `×10${[...String(Number(power))].map(c => SUPERSCRIPT[c]).join("")}` : "";
  return digits.replace("-", "−") + tens;
}

/** A value with so many significant digits. */
export function numberText(value, significant = 4) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e7 || size < 1e-4)) return written(value.toExponential(Math.max(0, significant - 2)));
  // A number with more digits before its point than are asked for keeps them.
  const places = size === 0 ? 0 : Math.max(0, significant - 1 - Math.floor(Math.log10(size)));
  return written(String(Number(value.toFixed(Math.min(10, places)))));
}

/** A tick of an axis whose ticks are `step` apart. */
function tickText(value, step) {
  if (Math.abs(value) < 1e-9 * step) return "0";
  if (Math.abs(value) >= 1e7 || step < 1e-5) return numberText(value, 4);
  return written(value.toFixed(Math.max(0, Math.ceil(-Math.log10(step) - 1e-9))));
}

/** Parts of a turn that people count in, degrees. */
const ANGLES = [15, 30, 45, 90, 180, 360];

/** Round values between `low` and `high`, at most about `most` of them: [value, text]. Angles that go far have parts of a turn. */
export function ticks(low, high, most, unit) {
  const least = (high - low) / Math.max(1, most), isAngle = unit === "°" && least > 10, all = [];
  const step = isAngle ? ANGLES.find(angle => angle >= least) ?? niceStep(least) : niceStep(least);
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) all.push([i * step, tickText(i * step, step)]);
  return all;
}

/** Round values of a logarithmic axis: 1, 2, 5 of each power of ten while these are few, else powers of ten. */
export function logTicks(low, high, most) {
  const decades = Math.log10(high / low);
  if (decades < 0.7) return ticks(low, high, most);
  const every = Math.max(1, Math.ceil(decades / Math.max(1, most))), factors = 3 * decades <= most ? [1, 2, 5] : [1], all = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) for (const k of factors) {
    const value = k * 10 ** power;
    if (power % every === 0 && value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9)) all.push([value, numberText(value, 1)]);
  }
  return all;
}

/** A scale from values `low` to `high` to pixels `from` to `to`: `at` gives the pixel of a value, `back` the inverse. */
export function scaleOf([low, high], from, to, isLog) {
  const into = isLog ? Math.log10 : v => v, out = isLog ? v => 10 ** v : v => v;
  const [a, b] = [into(low), into(high)], perUnit = (to - from) / (b - a);
  return { low, high, at: v => from + (into(v) - a) * perUnit, back: px => out(a + (px - from) / perUnit) };
}
