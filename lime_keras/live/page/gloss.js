// The gloss in words, and how sure the exponent is: lime_keras/optics/gloss.py.

const WORDS = ["matte", "satin", "glossy", "mirror-like"];
const WORD_WIDTH = 0.75; // Decades of s.
const BIN_WIDTH = 0.375;
const SHARE = 0.8;
const FLAT = 1.4;

/** The word for an exponent. */
export function word(exponent) {
  const place = Math.floor(Math.log10(Math.max(exponent, 1e-9)) / WORD_WIDTH);
  return WORDS[Math.min(Math.max(place, 0), WORDS.length - 1)];
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

/** Whether an interval is so wide that no word is sure. */
export function isFlat([low, high]) {
  return Math.log10(high / low) >= FLAT;
}

/** The word for a gloss, or the range of words where it is uncertain. */
export function inWords(exponent, ends) {
  if (!ends || !isFlat(ends)) return word(exponent);
  return `uncertain: ${word(ends[0])} to ${word(ends[1])}`;
}

/** The exponent with its interval. */
export function inNumbers(exponent, ends) {
  if (!ends) return digits(exponent);
  return `${digits(exponent)} (${digits(ends[0])} to ${digits(ends[1])})`;
}

const digits = (exponent) => (exponent >= 9.95 ? exponent.toFixed(0) : exponent.toFixed(1));
