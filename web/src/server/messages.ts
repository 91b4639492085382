/** Packs and unpacks envelopes: a JSON header and arrays of 32-bit floats, see src/interpose/studio/protocol.py. */

export type Arrays = Readonly<Record<string, { shape: readonly number[]; values: Float32Array }>>;

/** The bytes of a message, whose `arrays` field is set from the given arrays. */
export function pack(header: object, arrays: Arrays = {}): ArrayBuffer {
  const shapes = Object.fromEntries(Object.entries(arrays).map(([name, held]) => [name, held.shape]));
  const text = new TextEncoder().encode(JSON.stringify({ ...header, arrays: shapes }));
  const padded = Math.ceil(text.length / 4) * 4;
  const floats = Object.values(arrays).reduce((sum, held) => sum + held.values.length, 0);
  const bytes = new Uint8Array(4 + padded + 4 * floats);
  new DataView(bytes.buffer).setUint32(0, padded, true);
  bytes.fill(0x20, 4, 4 + padded);
  bytes.set(text, 4);
  let at = 4 + padded;
  for (const { values } of Object.values(arrays)) {
    bytes.set(new Uint8Array(values.buffer, values.byteOffset, values.byteLength), at);
    at += values.byteLength;
  }
  return bytes.buffer;
}

/** The header of a message, and its arrays as views into it. Throws if the two do not match. */
export function unpack<Header extends { arrays: Record<string, number[]> }>(
  data: ArrayBuffer,
): { header: Header; arrays: Arrays } {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))) as Header;
  const arrays: Record<string, { shape: number[]; values: Float32Array }> = {};
  let at = 4 + length;
  for (const [name, shape] of Object.entries(header.arrays)) {
    const count = shape.reduce((product, n) => product * n, 1);
    arrays[name] = { shape, values: new Float32Array(data, at, count) };
    at += 4 * count;
  }
  if (at !== data.byteLength) throw new Error(`the envelope has ${data.byteLength} bytes, but its header describes ${at}`);
  return { header, arrays };
}
