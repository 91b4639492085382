import { beforeEach, describe, expect, it } from "vitest";
import { lockGap, moveKeys, setGap, setPose } from "../../src/document/commands";
import { gapOf, gapsOf, type Document, type Gap } from "../../src/document/document";
import { Generator } from "../../src/engine/generator";
import type { Candidates, Generate } from "../../src/protocol";
import type { Answer, Question } from "../../src/server/connection";
import type { Arrays } from "../../src/wire";
import { keyed, pose, rig, STRIDE } from "../rigs";

interface Asked {
  question: Question & { type: "generate" };
  arrays: Arrays;
  answer(value?: number): Promise<void>;
  drop(): Promise<void>;
  fail(reason: string): Promise<void>;
}

const RIG = rig(100);
const INFO = {
  method: "dcmoe" as Generate["method"], style: null, trajectory: null, foot_slide: null, fit: null, path_deviation: null,
  fallback: null,
};

let asked: Asked[];
let generator: Generator;
let document: Document;

beforeEach(() => {
  asked = [];
  generator = new Generator(
    (question, arrays) =>
      new Promise((resolve, reject) => {
        const settle = async (act: () => void) => {
          act();
          await new Promise((done) => setTimeout(done));
        };
        asked.push({
          question,
          arrays,
          answer: (value = 1) => settle(() => resolve(answerOf(question, value))),
          drop: () => settle(() => resolve({ header: { type: "dropped", id: 0, gap: question.gap, arrays: {} }, arrays: {} })),
          fail: (reason) => settle(() => reject(new Error(reason))),
        });
      }),
    () => generator.sync(document, RIG),
  );
});

describe("what every gap shows", () => {
  it("is asked for from left to right, each going on from the motion before it", async () => {
    show(keyed([0, 20, 40]));
    expect(asked.map((each) => each.question.gap)).toEqual(["k0"]);
    expect(generator.state(gap("k20"))).toBe("waiting");
    await asked[0].answer(0.5);
    expect(generator.state(gap("k0"))).toBe("ready");
    expect(asked.map((each) => each.question.gap)).toEqual(["k0", "k20"]);
    expect(asked[1].arrays.start.shape).toEqual([10, STRIDE]);
    expect(asked[1].arrays.start.values[0]).toBe(0.5);
    expect(asked[1].arrays.start.values.slice(-STRIDE)).toEqual(document.keys[1].pose);
    await asked[1].answer();
    expect(generator.settled).toBe(true);
    expect(asked).toHaveLength(2);
  });

  it("arrives with the velocity of known motion after it", () => {
    show(lockGap(keyed([0, 20, 40]), "k20", new Float32Array(19 * STRIDE).fill(0.75)));
    expect(asked[0].arrays.target.shape).toEqual([10, STRIDE]);
    expect(asked[0].arrays.target.values.slice(0, STRIDE)).toEqual(document.keys[1].pose);
    expect(asked[0].arrays.target.values[STRIDE]).toBe(0.75);
  });

  it("is made again where the clip's own motion follows now, to run into it", async () => {
    const clip = { ...keyed([0, 20, 40]), keys: keyed([0, 20, 40]).keys.map((key) => ({ ...key, source: key.frame })) };
    show(clip);
    await asked[0].answer();
    await asked[1].answer();
    show(setGap(document, "k20", { method: "clip" }));
    expect(asked.slice(2).map((each) => each.question.gap)).toEqual(["k0"]);
    expect(asked[2].arrays.target.values[STRIDE]).toBeCloseTo(0.21, 6);
  });

  it("is made again only where something changed", async () => {
    show(keyed([0, 20, 40, 60]));
    for (let i = 0; i < 3; i++) await asked[i].answer();
    show(setGap(document, "k40", { style: "Angry" }));
    expect(asked.slice(3).map((each) => each.question.gap)).toEqual(["k40"]);
    await asked[3].answer();
    show(setGap(document, "k40", { chosen: 1 }));
    show(lockGap(document, "k20", generator.rows(gap("k20"))));
    expect(asked).toHaveLength(4);
  });

  it("does not ripple on where the motion before changed by next to nothing", async () => {
    show(keyed([0, 20, 40]));
    await asked[0].answer(0.5);
    await asked[1].answer(0.5);
    show(setGap(document, "k0", { seed: 7 }));
    await asked[2].answer(0.505);
    expect(asked).toHaveLength(3);
    show(setGap(document, "k0", { seed: 8 }));
    await asked[3].answer(0.9);
    expect(asked.map((each) => each.question.gap)).toEqual(["k0", "k20", "k0", "k0", "k20"]);
  });

  it("comes back at once after undo", async () => {
    const before = keyed([0, 20]);
    show(before);
    await asked[0].answer(0.25);
    show(setGap(before, "k0", { style: "Drunk" }));
    await asked[1].answer(0.75);
    expect(generator.rows(gap("k0"))[0]).toBe(0.75);
    show(before);
    expect(generator.rows(gap("k0"))[0]).toBe(0.25);
    expect(asked).toHaveLength(2);
  });

  it("is the last of many requests, whichever comes first", async () => {
    show(keyed([0, 20]));
    show(setGap(document, "k0", { seed: 2 }));
    await asked[1].answer(0.75);
    await asked[0].answer(0.25);
    expect(generator.rows(gap("k0"))[0]).toBe(0.75);
    expect(generator.state(gap("k0"))).toBe("ready");
  });

  it("is asked for again where the server dropped it", async () => {
    show(keyed([0, 20]));
    await asked[0].drop();
    expect(asked).toHaveLength(2);
  });

  it("tells a failure, does not ask again by itself, and does when told to or when something changes", async () => {
    show(keyed([0, 20]));
    await asked[0].fail("too far");
    expect([generator.state(gap("k0")), generator.failure("k0")]).toEqual(["failed", "too far"]);
    generator.sync(document, RIG);
    expect(asked).toHaveLength(1);
    generator.refresh("k0");
    expect(asked).toHaveLength(2);
    await asked[1].answer();
    expect(generator.state(gap("k0"))).toBe("ready");
  });
});

describe("while something is dragged", () => {
  beforeEach(async () => {
    show(keyed([0, 20, 40]));
    await asked[0].answer(0.5);
    await asked[1].answer(0.5);
    asked.length = 0;
  });

  it("one candidate is asked for both gaps, one at a time, then the whole", async () => {
    drag(moveKeys(document, ["k20"], 1));
    drag(moveKeys(document, ["k20"], 1));
    expect(asked.map(({ question }) => [question.gap, question.variants, question.live])).toEqual([
      ["k0", 1, true],
      ["k20", 1, true],
    ]);
    show(document);
    expect(asked).toHaveLength(2); // the live ones come first, and are shown
    await asked[0].answer(0.6);
    expect(generator.rows(gap("k0"))[0]).toBeCloseTo(0.6, 6);
    const last = asked.at(-1)!.question;
    expect([last.gap, last.frames, last.variants, last.live]).toEqual(["k0", 21, 4, false]);
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
    expect(asked.map(({ question }) => question.gap)).toEqual(["k0"]);
    await asked[0].answer(0.9);
    expect(asked.filter(({ question }) => question.live)).toHaveLength(1);
  });
});

describe("a project that was opened", () => {
  it("shows what it held until somebody asks for the other candidates", async () => {
    document = keyed([0, 20]);
    generator.reset(document, RIG, new Map([["k0", new Float32Array(19 * STRIDE).fill(0.125)]]));
    generator.sync(document, RIG);
    expect(asked).toHaveLength(0);
    expect([generator.state(gap("k0")), generator.rows(gap("k0"))[0]]).toEqual(["ready", 0.125]);
    generator.refresh("k0");
    await asked[0].answer(0.5);
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

function answerOf(question: Question & { type: "generate" }, value: number): Answer<Candidates> {
  const { variants, frames, gap, live } = question;
  const values = new Float32Array(variants * frames * STRIDE).fill(value);
  const header: Candidates = {
    type: "candidates", id: 0, gap, live, infos: Array.from({ length: variants }, () => INFO), seconds: 0.1, arrays: {},
  };
  return { header, arrays: { frames: { shape: [variants, frames, STRIDE], values } } };
}
