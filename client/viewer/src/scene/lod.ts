// Which version of each mesh to draw. Level -1 is the mesh itself, level N is MeshUpdate.levels[N].

export interface LodCandidate {
  id: string;
  distanceMu: number;     // from the eye to the nearest point of its bounding sphere, >= 0
  triangleCount: number;  // of the mesh itself
  levels: readonly { triangleCount: number; errorMu: number }[];  // each simpler than the one before
}

export interface LodOptions {
  pxPerMuAtUnitDistance: number;  // image height / (2 tan(fov / 2))
  tolerancePx: number;            // error that nobody sees
  maxTriangles: number;           // over all objects
}

const kMinDistanceMu = 1e-6;
const kMaxCoarsening = 12;

function coarsest(candidate: LodCandidate, options: LodOptions, tolerancePx: number): number {
  const pxPerMu = options.pxPerMuAtUnitDistance / Math.max(candidate.distanceMu, kMinDistanceMu);
  let level = -1;
  candidate.levels.forEach((l, n) => {
    if (l.errorMu * pxPerMu <= tolerancePx) level = n;
  });
  return level;
}

export const trianglesOf = (candidate: LodCandidate, level: number): number =>
  level < 0 ? candidate.triangleCount : (candidate.levels[level]?.triangleCount ?? candidate.triangleCount);

/** The coarsest levels whose error is not visible; if they have too many triangles, coarser ones for all. */
export function chooseLevels(candidates: readonly LodCandidate[], options: LodOptions): Map<string, number> {
  let tolerancePx = options.tolerancePx;
  let chosen = new Map<string, number>();
  for (let round = 0; round < kMaxCoarsening; ++round, tolerancePx *= 2) {
    chosen = new Map(candidates.map((c) => [c.id, coarsest(c, options, tolerancePx)]));
    const triangles = candidates.reduce((sum, c) => sum + trianglesOf(c, chosen.get(c.id) ?? -1), 0);
    if (triangles <= options.maxTriangles) break;
  }
  return chosen;
}
