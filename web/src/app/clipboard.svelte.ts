/** Copied keys. */

import type { Copied } from "../document/commands";
import { copyKeys, pasteKeys } from "../document/commands";
import { keyAtFrame } from "../document/document";
import type { Studio } from "../studio.svelte";

export class Clipboard {
  private held = $state.raw<Copied | null>(null);

  constructor(private readonly studio: Studio) {}

  get canPaste(): boolean {
    return this.held !== null && this.held.stride === this.studio.document?.stride;
  }

  copy(): void {
    const { document, chosenKeys } = this.studio;
    if (document && chosenKeys.length) this.held = copyKeys(document, chosenKeys);
  }

  /** Pastes the copied keys, starting at the playhead. */
  paste(): void {
    const { document, notices } = this.studio;
    const { frame } = this.studio.playback;
    if (!document || !this.held) return;
    if (!this.canPaste) notices.show("The copied pose is from a different rig.");
    else this.studio.putKey(pasteKeys(document, this.held, frame), frame, "Paste");
  }

  /** Duplicates the selected keys after the last of them. */
  duplicate(): void {
    this.copy();
    const { document, notices, chosenKeys } = this.studio;
    const last = document?.keys.findLast((key) => chosenKeys.includes(key.id));
    if (!document || !this.held || !last) return;
    const next = document.keys.find((key) => key.frame > last.frame);
    const frame = next ? Math.floor((last.frame + next.frame) / 2) : last.frame + Math.round(document.rate);
    if (keyAtFrame(document, frame)) notices.show("There is no room between these keys.");
    else this.studio.putKey(pasteKeys(document, this.held, frame), frame, "Duplicate");
  }
}
