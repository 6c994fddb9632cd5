// Adobe RGB, as cameras mark it in EXIF alone: browsers read an ICC profile, which is put in here.

const HEAD = 1 << 20; // bytes in which EXIF has to lie
const [JPEG, EXIF, PROFILE, PIXELS] = [0xffd8, 0xffe1, 0xffe2, 0xffda]; // markers

const text = (string) => [...string].map((one) => one.charCodeAt(0));
const number = (value, bytes = 4) =>
  Array.from({ length: bytes }, (_, k) => (value >>> (8 * (bytes - 1 - k))) & 255);
const fixed = (values) => values.flatMap((value) => number(Math.round(65536 * value)));
const zeros = (count) => Array(count).fill(0);

const NAME = "Adobe RGB, as EXIF says\0";
const CURVE = [...text("curv"), ...zeros(4), ...number(1), ...number(563, 2)]; // 563 / 256
const xyz = (...values) => [...text("XYZ "), ...zeros(4), ...fixed(values)];
const ELEMENTS = {
  desc: [...text("desc"), ...zeros(4), ...number(NAME.length), ...text(NAME), ...zeros(78)],
  cprt: [...text("text"), ...zeros(4), ...text("CC0\0")],
  wtpt: xyz(0.95045, 1, 1.08905),
  rXYZ: xyz(0.60974, 0.31111, 0.01947), // adapted to D50
  gXYZ: xyz(0.20528, 0.62567, 0.06087),
  bXYZ: xyz(0.14919, 0.06322, 0.74457),
  rTRC: CURVE,
  gTRC: CURVE,
  bTRC: CURVE,
};

/** A JPEG that EXIF alone calls Adobe RGB, with a profile that says so; any other file as it is. */
export async function withProfile(blob) {
  const place = placeOfProfile(new DataView(await blob.slice(0, HEAD).arrayBuffer()));
  if (!place) return blob;
  const content = [...text("ICC_PROFILE\0"), 1, 1, ...profile()];
  const segment = Uint8Array.from([...number(PROFILE, 2), ...number(content.length + 2, 2), ...content]);
  return new Blob([blob.slice(0, place), segment, blob.slice(place)], { type: blob.type });
}

/** Where the profile goes: behind EXIF; 0 where it has one, or needs none. */
function placeOfProfile(view) {
  let place = 0;
  try {
    if (view.getUint16(0) !== JPEG) return 0;
    for (let at = 2; view.getUint16(at) !== PIXELS; at += 2 + view.getUint16(at + 2)) {
      const [marker, kind] = [view.getUint16(at), view.getUint32(at + 4)];
      if (marker === PROFILE && kind === 0x4943435f) return 0; // ICC_
      const isExif = marker === EXIF && kind === 0x45786966; // Exif
      if (isExif && isAdobe(view, at + 10)) place = at + 2 + view.getUint16(at + 2);
    }
  } catch {
    return 0; // cut short or damaged: the browser may read it all the same
  }
  return place;
}

/** Whether EXIF that begins at `base` means Adobe RGB, as in Python (`picture_file`). */
function isAdobe(view, base) {
  const little = view.getUint16(base) === 0x4949;
  const short = (at) => view.getUint16(base + at, little);
  const long = (at) => view.getUint32(base + at, little);
  /** Where the value of a tag of the part at `at` lies; 0 if it is not there. */
  const place = (at, tag) => {
    for (let k = 0; at && k < short(at); k++) {
      if (short(at + 2 + 12 * k) === tag) return at + 10 + 12 * k;
    }
    return 0;
  };
  const part = (at, tag) => place(at, tag) && long(place(at, tag));
  const camera = part(long(4), 0x8769);
  const space = place(camera, 0xa001) && short(place(camera, 0xa001));
  const index = place(part(camera, 0xa005), 1);
  const isR03 = index > 0 && view.getUint32(base + index) >>> 8 === 0x523033;
  return space === 2 || (space !== 1 && isR03);
}

/** The bytes of an ICC profile of version 2. */
function profile() {
  const names = Object.keys(ELEMENTS);
  const start = 132 + 12 * names.length;
  const [table, content] = [[], []];
  for (const name of names) {
    const element = ELEMENTS[name];
    table.push(...text(name), ...number(start + content.length), ...number(element.length));
    content.push(...element, ...zeros(-element.length & 3));
  }
  const kind = [...number(0x02100000), ...text("mntrRGB XYZ "), ...zeros(12), ...text("acsp")];
  const white = fixed([0.9642, 1, 0.8249]);
  const header = [...number(start + content.length), ...zeros(4), ...kind, ...zeros(28), ...white, ...zeros(48)];
  return [...header, ...number(names.length), ...table, ...content];
}
