//! The sums as they are defined, for any processor, and the oracle of the faster implementation.

use half::f16;

/// See [`super::sh`].
pub fn sh(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    for (row, out) in transfer.chunks_exact(light.len()).zip(out) {
        let mut sum = [0.0; 3];
        for (t, l) in row.iter().zip(light) {
            let t = t.to_f32();
            for (s, l) in sum.iter_mut().zip(l) {
                *s += t * l;
            }
        }
        *out = sum;
    }
}

/// See [`super::sh_rgb_add`].
pub fn sh_rgb_add(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    for (row, out) in transfer.chunks_exact(light.len() * 3).zip(out) {
        for (t, l) in row.chunks_exact(3).zip(light) {
            for ((o, t), l) in out.iter_mut().zip(t).zip(l) {
                *o += t.to_f32() * l;
            }
        }
    }
}
