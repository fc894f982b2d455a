// A grid at the height where most objects stand, as a measure of size. Its lines are a round number of map units apart.
import { GridHelper, Group, type Box3 } from 'three';
import { niceStep } from '../state/geometry';

const kCells = 20;

export class GroundGrid {
  readonly group = new Group();
  step = 1;
  private key = '';

  /** `bottoms`: the heights of the bottoms of the cuboids. */
  set(box: Box3, bottoms: number[], color: string): void {
    if (box.isEmpty()) return;
    const extent = Math.max(box.max.x - box.min.x, box.max.y - box.min.y);
    this.step = niceStep((extent * 2.2) / kCells);
    const sorted = [...bottoms].sort((a, b) => a - b);
    const z = sorted[sorted.length >> 1] ?? box.min.z;
    const round = (v: number): number => Math.round(v / this.step) * this.step;
    const [x, y] = [round((box.min.x + box.max.x) / 2), round((box.min.y + box.max.y) / 2)];
    const key = [this.step, x, y, Math.round((z / this.step) * 20), color].join();
    if (key === this.key) return;
    this.key = key;
    for (const child of [...this.group.children]) {
      (child as GridHelper).dispose();
      this.group.remove(child);
    }
    const grid = new GridHelper(this.step * kCells, kCells, color, color);
    grid.rotation.x = Math.PI / 2;  // three.js has y up
    grid.position.set(x, y, z - 0.002 * extent);
    this.group.add(grid);
  }
}
