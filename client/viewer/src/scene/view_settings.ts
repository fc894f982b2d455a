import type { ColorMode } from './mesh_material';

export interface ViewSettings {
  color: ColorMode;
  meshes: boolean;
  cuboids: boolean;
  labels: boolean;
  points: boolean;
  path: boolean;
  image: boolean;
  grid: boolean;
  arrows: boolean;
  provisional: boolean;
  map: string | null;  // null: that of the newest pose
}

export const kDefaultSettings: ViewSettings = {
  color: 'rgb', meshes: true, cuboids: true, labels: true, points: true, path: true, image: true, grid: true,
  arrows: false, provisional: true, map: null,
};
