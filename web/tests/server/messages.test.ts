import { describe, expect, it } from "vitest";
import { pack, unpack } from "../../src/server/messages";

describe("an envelope", () => {
  const arrays = {
    start: { shape: [1, 3], values: new Float32Array([1, 2.5, -3]) },
    none: { shape: [0, 3], values: new Float32Array(0) },
    target: { shape: [2, 1], values: new Float32Array([4, 5]) },
  };

  it("gives its header and its arrays again, whatever the header's length", () => {
    for (const name of ["", "a", "ab", "abc", "Zähler ☃"]) {
      const { header, arrays: found } = unpack<{ name: string; arrays: Record<string, number[]> }>(pack({ name }, arrays));
      expect(header.name).toBe(name);
      expect(header.arrays).toEqual({ start: [1, 3], none: [0, 3], target: [2, 1] });
      expect(found).toEqual(arrays);
    }
  });

  it("takes the floats that a view shows, and no others", () => {
    const values = new Float32Array([9, 1, 2, 9]).subarray(1, 3);
    const { arrays: found } = unpack(pack({}, { a: { shape: [2], values } }));
    expect([...found.a.values]).toEqual([1, 2]);
  });

  it("is refused where header and bytes do not agree", () => {
    const bytes = new Uint8Array([...new Uint8Array(pack({}, arrays)), 0, 0, 0, 0]);
    expect(() => unpack(bytes.buffer)).toThrow("envelope");
  });
});
