// Made from src/meshreel/geometry/ground.py, which explains these, by scripts/generate. Do not edit.

export const TEXELS = 256;
export const ASIDE = 0.35;
export const REACH = 0.5;
export const RIM = 2;
export const BELOW = 0.002;
export const GLOW = 0.12;
