// Colors of the 3D view, for dark and light.
export interface SceneColors {
  background: string; grid: string; points: string; path: string; pathGap: string; relocalized: string; frustum: string;
  cuboid: string; provisional: string; lost: string; selected: string; arrow: string; measure: string;
}

export const kDark: SceneColors = {
  background: '#0d1218', grid: '#263341', points: '#8fa3b8', path: '#38bdf8', pathGap: '#ef6461', relocalized: '#facc15',
  frustum: '#f8fafc', cuboid: '#5eead4', provisional: '#64748b', lost: '#f59e0b', selected: '#ffffff',
  arrow: '#facc15', measure: '#f472b6',
};

export const kLight: SceneColors = {
  background: '#eef2f6', grid: '#cfd8e2', points: '#64748b', path: '#0369a1', pathGap: '#c53030', relocalized: '#a16207',
  frustum: '#0f172a', cuboid: '#0f766e', provisional: '#94a3b8', lost: '#b45309', selected: '#020617',
  arrow: '#a16207', measure: '#be185d',
};
