/** Short messages in a corner, each with at most one action. */

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

  show(text: string, kind: Notice["kind"] = "info", action: Notice["action"] = null): void {
    const id = this.next++;
    const others = this.all.filter((notice) => notice.text !== text);
    this.all = [...others, { id, text, kind, action }].slice(-MOST);
    if (!action) setTimeout(() => this.dismiss(id), LASTS_MS[kind]);
  }

  /** Shows the message of an error. */
  warn(error: unknown): void {
    this.show(error instanceof Error ? error.message : String(error), "error");
  }

  dismiss(id: number): void {
    this.all = this.all.filter((notice) => notice.id !== id);
  }
}
