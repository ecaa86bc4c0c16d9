//! Seeded clouds and transforms shared by the tests.

use std::f64::consts::TAU;

pub(crate) type Vec3 = [f64; 3];

/// A separate small generator (PCG-XSH-RR), so that the tests do not depend on the one under test.
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        let mut rng = Self(seed.wrapping_mul(2) | 1);
        for _ in 0..8 {
            rng.bits();
        }
        rng
    }

    pub(crate) fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 =
            old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let [low, high] = [(((old >> 18) ^ old) >> 27) & 0xffff_ffff, old >> 59];
        u32::try_from(low)
            .expect("masked to 32 bits")
            .rotate_right(u32::try_from(high).expect("5 bits"))
    }

    /// Uniform in [0,1).
    pub(crate) fn uniform(&mut self) -> f64 {
        f64::from(self.bits()) / 4_294_967_296.0
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.bits() as usize % n
    }

    pub(crate) fn on_sphere(&mut self) -> Vec3 {
        let u = 2.0 * self.uniform() - 1.0;
        let (ring, angle) = ((1.0 - u * u).sqrt(), TAU * self.uniform());
        [ring * angle.cos(), ring * angle.sin(), u]
    }
}

/// Uniform in the unit cube.
pub(crate) fn cube(n: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = Rng::new(seed);
    (0..n).map(|_| [rng.uniform(), rng.uniform(), rng.uniform()]).collect()
}

/// A figure-like cloud: slightly noisy surfaces of an ellipsoid body, a head and four limbs.
pub(crate) fn figure(n: usize, seed: u64) -> Vec<Vec3> {
    const PARTS: [(Vec3, Vec3, f64); 6] = [
        ([0.0, 0.0, 0.0], [0.2, 0.12, 0.3], 0.5),
        ([0.0, 0.0, 0.42], [0.1, 0.1, 0.12], 0.14),
        ([0.3, 0.0, 0.1], [0.06, 0.06, 0.3], 0.2),
        ([-0.3, 0.0, 0.1], [0.06, 0.06, 0.3], 0.2),
        ([0.1, 0.0, -0.6], [0.08, 0.08, 0.35], 0.3),
        ([-0.1, 0.0, -0.6], [0.08, 0.08, 0.35], 0.3),
    ];
    let mut rng = Rng::new(seed);
    let point = |_| {
        let mut area = rng.uniform() * PARTS.iter().map(|part| part.2).sum::<f64>();
        let mut part = 0;
        while area > PARTS[part].2 && part < 5 {
            area -= PARTS[part].2;
            part += 1;
        }
        let (center, radii, _) = PARTS[part];
        let on = rng.on_sphere();
        [0, 1, 2].map(|d| center[d] + radii[d] * on[d] + 0.001 * (rng.uniform() - 0.5))
    };
    (0..n).map(point).collect()
}

/// Integer lattice points drawn with replacement, with many ties and coincident points.
pub(crate) fn lattice(n: usize, side: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = Rng::new(seed);
    (0..n).map(|_| [0, 1, 2].map(|_| rng.below(side) as f64)).collect()
}

/// `permutation[new] = old`.
pub(crate) fn permutation(n: usize, seed: u64) -> Vec<usize> {
    let mut rng = Rng::new(seed);
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, rng.below(i + 1));
    }
    order
}

pub(crate) fn distance2(a: &Vec3, b: &Vec3) -> f64 {
    (0..3).map(|d| (a[d] - b[d]).powi(2)).sum()
}

/// A similarity: rotation, then scale, then shift.
pub(crate) struct Similarity {
    rotation: [Vec3; 3],
    scale: f64,
    shift: Vec3,
}

impl Similarity {
    pub(crate) fn new(axis: Vec3, angle: f64, scale: f64, shift: Vec3) -> Self {
        let length = distance2(&axis, &[0.0; 3]).sqrt();
        let [x, y, z] = axis.map(|a| a / length);
        let (s, c) = angle.sin_cos();
        let t = 1.0 - c;
        let rotation = [
            [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
            [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
            [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
        ];
        Self { rotation, scale, shift }
    }

    pub(crate) fn direction(&self, v: &Vec3) -> Vec3 {
        self.rotation.map(|row| (0..3).map(|d| row[d] * v[d]).sum())
    }

    pub(crate) fn point(&self, p: &Vec3) -> Vec3 {
        let turned = self.direction(p);
        [0, 1, 2].map(|d| self.scale * turned[d] + self.shift[d])
    }
}
