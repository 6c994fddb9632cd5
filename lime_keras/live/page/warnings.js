// The reasons to distrust an estimate, in words for who holds the object; codes are those of
// lime_keras/estimate/cautions.py, and `no-light`.

const WORDS = {
  "no-object": "No object was found: hold it nearer and before a calm background, or mend the mask.",
  "uncertain-mask":
    "The outline is uncertain, and so are the numbers: if it is wrong, take a calmer background, or mend the mask.",
  "small-object": "The object is small in the picture; often its outline is then wrong: bring it nearer.",
  "few-pixels": "The object has too few pixels to show its gloss: bring it nearer, or take a larger picture.",
  "touches-frame": "The object reaches the picture's edge, so a part may be cut off: leave room around it.",
  "many-parts":
    "The outline falls into parts, and all are taken for one object of one material: show one, or mend the mask.",
  "too-dark": "The object is nearly black: turn on a light, or expose the picture longer.",
  underexposed: "Nothing in the picture is bright, so the colours may come out too dark: expose it longer.",
  clipped: "Much of the object is burnt out to white: take less light, or expose the picture shorter.",
  "burnt-highlight": "Highlights are burnt out to white: take less light, or expose the picture shorter.",
  grey: "The picture shows no colour of the object, which helps to tell its highlights: take one in colour.",
  "second-colour":
    "The object seems to have several colours, and the numbers are one for all: show one, or mend the mask.",
  "no-light": "No light was found from it: the virtual object keeps the one that it has.",
};

/** A warning {code, message} in the page's words, or in its own if the page has none. */
export function words({ code, message }) {
  return WORDS[code] ?? message;
}
