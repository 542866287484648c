/**
 * Files of NumPy arrays, .npz: an archive without compression, whose members are .npy files.
 *
 * The formats: https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html and
 * https://pkware.cachefly.net/webdocs/casestudies/APPNOTE.TXT
 */

/** A text as an array without dimensions: [type, shape, bytes]. */
export function textArray(text) {
  const points = Uint32Array.from(text, (letter) => letter.codePointAt(0));
  return [`'<U${points.length}'`, [], new Uint8Array(points.buffer)];
}

/**
 * The bytes of an .npz file.
 *
 * @param {Object<string, Array>} arrays - [type as NumPy writes it, shape, bytes] by name.
 */
export function npz(arrays) {
  const [members, directory] = [[], []];
  let offset = 0;
  for (const [name, array] of Object.entries(arrays)) {
    const [content, label] = [npy(...array), new TextEncoder().encode(`${name}.npy`)];
    const [crc, size] = [crc32(content), content.length];
    // Version 2.0, no flags, no compression, 1 January 1980, and the sizes.
    const common = [u16(20), u16(0), u16(0), u16(0), u16(0x21), u32(crc), u32(size), u32(size), u16(label.length), u16(0)];
    const head = joined([u32(0x04034b50), ...common, label]);
    members.push(head, content);
    directory.push(u32(0x02014b50), u16(20), ...common, u16(0), u16(0), u16(0), u32(0), u32(offset), label);
    offset += head.length + size;
  }
  const listed = joined(directory);
  const count = u16(members.length / 2);
  const end = [u32(0x06054b50), u16(0), u16(0), count, count, u32(listed.length), u32(offset), u16(0)];
  return joined([...members, listed, ...end]);
}

/** The bytes of an .npy file, version 1.0. */
function npy(type, shape, bytes) {
  const dimensions = shape.map((size) => `${size},`).join(" ");
  const facts = `{'descr': ${type}, 'fortran_order': False, 'shape': (${dimensions}), }`;
  const start = 10; // magic string, version and the header's length
  const header = new TextEncoder().encode(facts.padEnd(Math.ceil((start + facts.length + 1) / 64) * 64 - start - 1) + "\n");
  return joined([Uint8Array.of(0x93), new TextEncoder().encode("NUMPY"), Uint8Array.of(1, 0), u16(header.length), header, bytes]);
}

function u16(number) {
  return Uint8Array.of(number & 255, number >>> 8);
}

function u32(number) {
  return Uint8Array.of(number & 255, (number >>> 8) & 255, (number >>> 16) & 255, number >>> 24);
}

function joined(parts) {
  const whole = new Uint8Array(parts.reduce((size, part) => size + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) {
      crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
    }
  }
  return ~crc >>> 0;
}
