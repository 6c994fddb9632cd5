// The gloss in words, and how sure the exponent is: lime_keras/optics/gloss.py.

const WORDS = ["matte", "satin", "semi-gloss", "glossy", "high-gloss"];
const EDGES = [1.5, 1.875, 2.25, 2.625];
const PLASTIC = 0.04;
const MIRROR = 0.3;
const [EVEN, SURE] = [0.6, 0.85];
const BIN_WIDTH = 0.375;
const SHARE = 0.8;

/** The level of gloss: log10 s, less where the specular albedo is below a plastic's. */
export function level(exponent, specular) {
  const strength = Math.min(Math.max(specular, 1e-9) / PLASTIC, 1);
  return Math.log10(Math.max(exponent, 1e-9)) + Math.log10(strength);
}

/** The word for a material that is known. */
export function word(exponent, specular) {
  const place = EDGES.filter((edge) => level(exponent, specular) >= edge).length;
  return specular >= MIRROR && place >= WORDS.indexOf("glossy") ? "mirror-like" : WORDS[place];
}

/** The probability that a material is glossy, from its estimate and the model's calibration. */
export function probability({ even, slope }, exponent, specular) {
  return 1 / (1 + Math.exp(-slope * (level(exponent, specular) - even)));
}

/** The words for an estimated gloss: the likelier side, or both where that is even. */
export function describe(glossy, exponent, specular) {
  const likely = Math.max(glossy, 1 - glossy);
  if (likely < EVEN) return "satin to semi-gloss";
  if (likely < SURE) return `rather ${glossy > 0.5 ? "glossy" : "matte"} (${(100 * likely).toFixed(0)} %)`;
  if (glossy < 0.5) return "matte or satin";
  const finer = word(exponent, specular);
  return ["high-gloss", "mirror-like"].includes(finer) ? finer : "glossy";
}

/** [low, high] between which s lies with probability SHARE; null without probabilities. */
export function interval(probabilities) {
  if (!probabilities) return null;
  const whole = probabilities.reduce((sum, value) => sum + value, 0);
  return [(1 - SHARE) / 2, (1 + SHARE) / 2].map((target) => {
    let before = 0;
    for (const [bin, value] of probabilities.entries()) {
      if (before + value >= target * whole) {
        return 10 ** (BIN_WIDTH * (bin + (target * whole - before) / value));
      }
      before += value;
    }
    return 10 ** (BIN_WIDTH * probabilities.length);
  });
}

/** The exponent with its interval. */
export function inNumbers(exponent, ends) {
  if (!ends) return digits(exponent);
  return `${digits(exponent)} (${digits(ends[0])} to ${digits(ends[1])})`;
}

const digits = (exponent) => (exponent >= 9.95 ? exponent.toFixed(0) : exponent.toFixed(1));
