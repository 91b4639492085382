/** The websocket: sends queries, returns their answers, and reconnects when the connection is lost. */

import type { ClientMessage, Candidates, Dropped, Failed, LibraryPoses, MirroredPose, SuggestedDurations, ServerMessage, GalleryPaths, Welcome } from "../protocol";
import type { Arrays } from "./messages";
import { pack, unpack } from "./messages";

type Unaddressed<T> = T extends unknown ? Omit<T, "id" | "arrays"> : never;
export type Query = Unaddressed<Exclude<ClientMessage, { type: "cancel" }>>;

interface Answers {
  generate: Candidates | Dropped;
  suggest: SuggestedDurations;
  paths: GalleryPaths;
  mirror: MirroredPose;
  library: LibraryPoses;
}

export interface Answer<T> {
  readonly header: T;
  readonly arrays: Arrays;
}

/** Why a query has no answer. again: the server does not know the rig (any more). */
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
  resolve(answer: Answer<ServerMessage>): void;
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

  ask<Q extends Query>(query: Q, arrays: Arrays = {}): Promise<Answer<Answers[Q["type"]]>> {
    const id = this.next++;
    const bytes = pack({ ...query, id }, arrays);
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve: resolve as Waiting["resolve"], reject });
      this.send(bytes);
    });
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
      const why = reason || "the connection to the studio's server was lost";
      for (const { reject } of this.waiting.values()) reject(new Unanswered(why));
      this.waiting.clear();
      this.unsent = [];
      this.events.state("lost", why);
      this.timer = setTimeout(() => this.connect(), PATIENCE[Math.min(this.failures++, PATIENCE.length - 1)]);
    };
  }

  private receive(data: ArrayBuffer): void {
    const { header, arrays } = unpack<ServerMessage>(data);
    if (header.type === "welcome") return this.events.welcome(header);
    const waiting = this.waiting.get(header.id);
    if (!waiting) return;
    this.waiting.delete(header.id);
    if (header.type === "failed") waiting.reject(new Unanswered((header as Failed).reason, header.again));
    else waiting.resolve({ header, arrays });
  }
}
