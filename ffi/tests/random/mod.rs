//! Random numbers that are the same in every run.

/// A linear congruential generator (Knuth's MMIX constants).
pub struct Random(pub u64);

impl Random {
    /// Uniform in [0, 1), 24 bits of it.
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Uniform in the cube from -1 to 1.
    pub fn point(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| 2.0 * self.next() - 1.0)
    }
}
