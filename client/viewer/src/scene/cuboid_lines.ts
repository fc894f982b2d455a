// All cuboids in one drawing call.
import { BufferAttribute, BufferGeometry, Color, LineBasicMaterial, LineSegments } from 'three';
import { corners, kEdges } from '../state/geometry';
import type { ObjectUpdate } from '../api/types';
import type { SceneColors } from './colors';

export class CuboidLines {
  readonly lines = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));

  constructor() {
    this.lines.frustumCulled = false;
  }

  set(objects: readonly ObjectUpdate[], selected: string | null, colors: SceneColors): void {
    const positions = new Float32Array(objects.length * 24 * 3);
    const rgb = new Float32Array(objects.length * 24 * 3);
    let n = 0;
    const color = new Color();
    for (const object of objects) {
      if (!object.cuboid) continue;
      const points = corners(object.cuboid);
      color.set(object.id === selected ? colors.selected : object.state === 'LOST' ? colors.lost
        : object.state === 'PROVISIONAL' ? colors.provisional : colors.cuboid);
      for (const edge of kEdges) {
        for (const end of edge) {
          const p = points[end];
          if (!p) continue;
          positions.set([p.x, p.y, p.z], n);
          rgb.set([color.r, color.g, color.b], n);
          n += 3;
        }
      }
    }
    this.lines.geometry.dispose();
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('color', new BufferAttribute(rgb, 3));
    geometry.setDrawRange(0, n / 3);
    this.lines.geometry = geometry;
  }
}
