/** Short messages in a corner: what went wrong or was done, in words, with at most one thing to do about it. */

export interface Notice {
  readonly id: number;
  readonly text: string;
  readonly kind: "info" | "warning" | "error";
  readonly action: { readonly label: string; run(): void } | null;
}

const LASTS_MS = { info: 5000, warning: 9000, error: 20000 };
const MOST = 4;

export class Notices {
  all = $state.raw<readonly Notice[]>([]);
  private next = 1;

  say(text: string, kind: Notice["kind"] = "info", action: Notice["action"] = null): void {
    const id = this.next++;
    const others = this.all.filter((notice) => notice.text !== text);
    this.all = [...others, { id, text, kind, action }].slice(-MOST);
    if (!action) setTimeout(() => this.dismiss(id), LASTS_MS[kind]);
  }

  /** An error as its sentence. */
  warn(error: unknown): void {
    this.say(error instanceof Error ? error.message : String(error), "error");
  }

  dismiss(id: number): void {
    this.all = this.all.filter((notice) => notice.id !== id);
  }
}
