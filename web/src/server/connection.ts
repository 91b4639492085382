/** The websocket: questions and their answers, and a new connection when the old one is lost. */

import type { Asked, Candidates, Dropped, Failed, LibraryPoses, Posed, Suggested, Told, Ways, Welcome } from "../protocol";
import type { Arrays } from "../wire";
import { pack, unpack } from "../wire";

type Unaddressed<T> = T extends unknown ? Omit<T, "id" | "arrays"> : never;
export type Question = Unaddressed<Exclude<Asked, { type: "cancel" }>>;

interface Answers {
  generate: Candidates | Dropped;
  suggest: Suggested;
  paths: Ways;
  mirror: Posed;
  library: LibraryPoses;
}

export interface Answer<T> {
  readonly header: T;
  readonly arrays: Arrays;
}

/** Why a question has no answer. again: the server does not know the rig (any more). */
export class Unanswered extends Error {
  constructor(
    reason: string,
    readonly again = false,
  ) {
    super(reason);
  }
}

export type State = "connecting" | "open" | "lost";

interface Waiting {
  resolve(answer: Answer<Told>): void;
  reject(error: Error): void;
}

const PATIENCE = [250, 500, 1000, 2000, 4000];

export class Connection {
  private socket: WebSocket | null = null;
  private waiting = new Map<number, Waiting>();
  private unsent: ArrayBuffer[] = [];
  private next = 1;
  private failures = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly url: string,
    private readonly events: {
      state(state: State, reason: string): void;
      welcome(welcome: Welcome): void;
    },
  ) {
    this.connect();
  }

  ask<Q extends Question>(question: Q, arrays: Arrays = {}): Promise<Answer<Answers[Q["type"]]>> {
    const id = this.next++;
    const bytes = pack({ ...question, id }, arrays);
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve: resolve as Waiting["resolve"], reject });
      this.send(bytes);
    });
  }

  cancel(gap: string): void {
    this.send(pack({ type: "cancel", gap }));
  }

  close(): void {
    clearTimeout(this.timer);
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  private send(bytes: ArrayBuffer): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(bytes);
    else this.unsent.push(bytes);
  }

  private connect(): void {
    this.events.state("connecting", "");
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.failures = 0;
      this.events.state("open", "");
      for (const bytes of this.unsent.splice(0)) socket.send(bytes);
    };
    socket.onmessage = ({ data }) => this.receive(data as ArrayBuffer);
    socket.onclose = ({ reason }) => {
      if (socket !== this.socket) return;
      const said = reason || "the connection to the studio's server was lost";
      for (const { reject } of this.waiting.values()) reject(new Unanswered(said));
      this.waiting.clear();
      this.unsent = [];
      this.events.state("lost", said);
      this.timer = setTimeout(() => this.connect(), PATIENCE[Math.min(this.failures++, PATIENCE.length - 1)]);
    };
  }

  private receive(data: ArrayBuffer): void {
    const { header, arrays } = unpack<Told>(data);
    if (header.type === "welcome") return this.events.welcome(header);
    const waiting = this.waiting.get(header.id);
    if (!waiting) return;
    this.waiting.delete(header.id);
    if (header.type === "failed") waiting.reject(new Unanswered((header as Failed).reason, header.again));
    else waiting.resolve({ header, arrays });
  }
}
