import { beforeEach, describe, expect, it } from "vitest";
import { lockGap, moveKeys, setGap, setPose } from "../../src/document/commands";
import { gapOf, gapsOf, type Document, type Gap } from "../../src/document/document";
import { Generator } from "../../src/engine/generator";
import type { Candidates } from "../../src/protocol";
import type { Answer, Query } from "../../src/server/connection";
import type { Arrays } from "../../src/server/messages";
import { keyed, pose, rig, STRIDE } from "../rigs";

interface ClientMessage {
  query: Query & { type: "generate" };
  arrays: Arrays;
  answer(value?: number): Promise<void>;
  drop(): Promise<void>;
  fail(reason: string): Promise<void>;
}

const RIG = rig(100);
const INFO = {
  method: "dcmoe", model: null, style: null, trajectory: null, foot_slide: null, fit: null, path_deviation: null,
  fallback: null,
};

let request: ClientMessage[];
let generator: Generator;
let document: Document;

beforeEach(() => {
  request = [];
  generator = new Generator(
    (query, arrays) =>
      new Promise((resolve, reject) => {
        const settle = async (act: () => void) => {
          act();
          await new Promise((done) => setTimeout(done));
        };
        request.push({
          query,
          arrays,
          answer: (value = 1) => settle(() => resolve(answerOf(query, value))),
          drop: () => settle(() => resolve({ header: { type: "dropped", id: 0, gap: query.gap, arrays: {} }, arrays: {} })),
          fail: (reason) => settle(() => reject(new Error(reason))),
        });
      }),
    () => generator.sync(document, RIG),
  );
});

describe("what every gap shows", () => {
  it("is request for from left to right, each going on from the motion before it", async () => {
    show(keyed([0, 20, 40]));
    expect(request.map((each) => each.query.gap)).toEqual(["k0"]);
    expect(generator.state(gap("k20"))).toBe("waiting");
    await request[0].answer(0.5);
    expect(generator.state(gap("k0"))).toBe("ready");
    expect(request.map((each) => each.query.gap)).toEqual(["k0", "k20"]);
    expect(request[1].arrays.start.shape).toEqual([10, STRIDE]);
    expect(request[1].arrays.start.values[0]).toBe(0.5);
    expect(request[1].arrays.start.values.slice(-STRIDE)).toEqual(document.keys[1].pose);
    await request[1].answer();
    expect(generator.settled).toBe(true);
    expect(request).toHaveLength(2);
  });

  it("arrives with the velocity of known motion after it", () => {
    show(lockGap(keyed([0, 20, 40]), "k20", new Float32Array(19 * STRIDE).fill(0.75)));
    expect(request[0].arrays.target.shape).toEqual([10, STRIDE]);
    expect(request[0].arrays.target.values.slice(0, STRIDE)).toEqual(document.keys[1].pose);
    expect(request[0].arrays.target.values[STRIDE]).toBe(0.75);
  });

  it("starts from the completed pose where only some joints of the key before it are given", async () => {
    show(setGap(keyed([0, 20, 40]), "k0", { target_joints: "hands", variants: 1 }));
    expect(request[0].query.settings.target_joints).toBe("hands");
    await request[0].answer(0.5);
    const target = generator.pose(document.keys[1]);
    expect(target[0]).toBe(0.5);
    expect(request.at(-1)!.query.gap).toBe("k20");
    expect(request.at(-1)!.arrays.start.values.slice(-STRIDE)).toEqual(target);
    const locked = lockGap(document, "k0", generator.rows(gap("k0")), target);
    expect(locked.keys[1].pose).toEqual(target);
    expect(document.keys[1].pose).not.toEqual(target);
  });

  it("meets the whole target where the motion after it is locked", () => {
    show(lockGap(setGap(keyed([0, 20, 40]), "k0", { target_joints: "hands" }), "k20", new Float32Array(19 * STRIDE)));
    expect(request[0].query.settings.target_joints).toBe(null);
  });

  it("is made again where the clip's own motion follows now, to run into it", async () => {
    const clip = { ...keyed([0, 20, 40]), keys: keyed([0, 20, 40]).keys.map((key) => ({ ...key, source: key.frame })) };
    show(clip);
    await request[0].answer();
    await request[1].answer();
    show(setGap(document, "k20", { method: "clip" }));
    expect(request.slice(2).map((each) => each.query.gap)).toEqual(["k0"]);
    expect(request[2].arrays.target.values[STRIDE]).toBeCloseTo(0.21, 6);
  });

  it("is made again only where something changed", async () => {
    show(keyed([0, 20, 40, 60]));
    for (let i = 0; i < 3; i++) await request[i].answer();
    show(setGap(document, "k40", { style: "Angry" }));
    expect(request.slice(3).map((each) => each.query.gap)).toEqual(["k40"]);
    await request[3].answer();
    show(setGap(document, "k40", { chosen: 1 }));
    show(lockGap(document, "k20", generator.rows(gap("k20"))));
    expect(request).toHaveLength(4);
  });

  it("does not ripple on where the motion before changed by next to nothing", async () => {
    show(keyed([0, 20, 40]));
    await request[0].answer(0.5);
    await request[1].answer(0.5);
    show(setGap(document, "k0", { seed: 7 }));
    await request[2].answer(0.505);
    expect(request).toHaveLength(3);
    show(setGap(document, "k0", { seed: 8 }));
    await request[3].answer(0.9);
    expect(request.map((each) => each.query.gap)).toEqual(["k0", "k20", "k0", "k0", "k20"]);
  });

  it("comes back at once after undo", async () => {
    const before = keyed([0, 20]);
    show(before);
    await request[0].answer(0.25);
    show(setGap(before, "k0", { style: "Drunk" }));
    await request[1].answer(0.75);
    expect(generator.rows(gap("k0"))[0]).toBe(0.75);
    show(before);
    expect(generator.rows(gap("k0"))[0]).toBe(0.25);
    expect(request).toHaveLength(2);
  });

  it("is the last of many requests, whichever comes first", async () => {
    show(keyed([0, 20]));
    show(setGap(document, "k0", { seed: 2 }));
    await request[1].answer(0.75);
    await request[0].answer(0.25);
    expect(generator.rows(gap("k0"))[0]).toBe(0.75);
    expect(generator.state(gap("k0"))).toBe("ready");
  });

  it("is request for again where the server dropped it", async () => {
    show(keyed([0, 20]));
    await request[0].drop();
    expect(request).toHaveLength(2);
  });

  it("tells a failure, does not ask again by itself, and does when told to or when something changes", async () => {
    show(keyed([0, 20]));
    await request[0].fail("too far");
    expect([generator.state(gap("k0")), generator.failure("k0")]).toEqual(["failed", "too far"]);
    generator.sync(document, RIG);
    expect(request).toHaveLength(1);
    generator.refresh("k0");
    expect(request).toHaveLength(2);
    await request[1].answer();
    expect(generator.state(gap("k0"))).toBe("ready");
  });
});

describe("while something is dragged", () => {
  beforeEach(async () => {
    show(keyed([0, 20, 40]));
    await request[0].answer(0.5);
    await request[1].answer(0.5);
    request.length = 0;
  });

  it("one candidate is request for both gaps, one at a time, then the whole", async () => {
    drag(moveKeys(document, ["k20"], 1));
    drag(moveKeys(document, ["k20"], 1));
    expect(request.map(({ query }) => [query.gap, query.settings.variants, query.live])).toEqual([
      ["k0", 4, true],
      ["k20", 4, true],
    ]);
    show(document);
    expect(request).toHaveLength(2); // the live ones come first, and are shown
    await request[0].answer(0.6);
    expect(generator.rows(gap("k0"))[0]).toBeCloseTo(0.6, 6);
    const last = request.at(-1)!.query;
    expect([last.gap, last.frames, last.settings.variants, last.live]).toEqual(["k0", 21, 4, false]);
  });

  it("what was shown is stretched until there is more", () => {
    drag(setPose(document, "k20", pose(3)));
    expect(generator.rows(gap("k0"))[0]).toBe(0.5);
    drag(moveKeys(document, ["k20"], 5));
    expect(generator.rows(gap("k0"))).toHaveLength(24 * STRIDE);
    expect(generator.rows(gap("k0"))).toBe(generator.rows(gap("k0")));
  });

  it("gaps that were not touched stay", async () => {
    drag(setPose(document, "k0", pose(3)));
    expect(request.map(({ query }) => query.gap)).toEqual(["k0"]);
    await request[0].answer(0.9);
    expect(request.filter(({ query }) => query.live)).toHaveLength(1);
  });
});

describe("a project that was opened", () => {
  it("shows what it held until somebody asks for the other candidates", async () => {
    document = keyed([0, 20]);
    generator.reset(document, RIG, new Map([["k0", new Float32Array(19 * STRIDE).fill(0.125)]]));
    generator.sync(document, RIG);
    expect(request).toHaveLength(0);
    expect([generator.state(gap("k0")), generator.rows(gap("k0"))[0]]).toEqual(["ready", 0.125]);
    generator.refresh("k0");
    await request[0].answer(0.5);
    expect(generator.result("k0")?.candidates).toHaveLength(4);
  });
});

function show(next: Document): void {
  document = next;
  generator.sync(next, RIG);
}

function drag(next: Document): void {
  document = next;
  generator.sync(next, RIG, true);
}

function gap(id: string): Gap {
  return gapOf(document, id) ?? gapsOf(document)[0];
}

function answerOf(query: Query & { type: "generate" }, value: number): Answer<Candidates> {
  const { settings, frames, gap, live } = query;
  const variants = live ? 1 : settings.variants;
  const values = new Float32Array(variants * frames * STRIDE).fill(value);
  const header: Candidates = {
    type: "candidates", id: 0, gap, live, infos: Array.from({ length: variants }, () => INFO), seconds: 0.1, arrays: {},
  };
  const targets = { shape: [variants, STRIDE], values: new Float32Array(variants * STRIDE).fill(value) };
  const frameRows = { shape: [variants, frames, STRIDE], values };
  return { header, arrays: settings.target_joints ? { frames: frameRows, targets } : { frames: frameRows } };
}
