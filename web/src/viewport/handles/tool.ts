/** Base of the tools that change a pose in the view. */

import { Group } from "three";
import type { Pose, Rig } from "../../rig";
import type { Palette } from "../scene/palette";

export abstract class PoseTool {
  readonly group = new Group();
  /** What the tool works on; null while it is inactive. */
  protected on: { readonly rig: Rig; readonly pose: Pose; readonly palette: Palette } | null = null;

  update(rig: Rig | null, pose: Pose | null, palette: Palette): void {
    this.on = rig && pose && { rig, pose, palette };
    this.group.visible = this.on !== null;
    this.build();
  }

  protected abstract build(): void;
}
