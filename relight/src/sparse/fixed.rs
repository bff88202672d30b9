//! A light in whole numbers of 16 bits, for products of bytes with it that are exact and cost half of those in floats.
//!
//! Entry e of a colour is step (coarse\[e\] + rest\[e\] / [`WHOLE`]), to 32 bits of the largest. The coarse part alone is wrong
//! by up to half a step, the largest entry being [`WHOLE`] of them: for most lights no matter, but where few entries are far brighter
//! than the others ([`BRIGHTEST`]) the rest is asked for too. Entries are in sections that have steps of their own.

/// Steps of the largest entry.
pub const WHOLE: f32 = 32767.0;

/// The rest counts where the largest entry is more than this many times the mean: a row of one dim texel of a tenth of the
/// mean is then at most 2 % off, of thirty such texels 0.2 % by standard error.
const BRIGHTEST: f32 = 128.0;

/// A list of entries of three colours.
#[derive(Clone, Debug)]
pub struct Fixed {
    /// Section i has the entries `ends[i - 1]..ends[i]`.
    ends: Vec<usize>,
    /// Per section and colour.
    steps: Vec<[f32; 3]>,
    coarse: [Vec<i16>; 3],
    rest: [Vec<i16>; 3],
    has_rest: bool,
}

/// Per colour, one entry more than there are.
pub type Planes<'a> = [&'a [i16]; 3];

impl Fixed {
    /// Darkness, in sections that end there.
    pub fn new(ends: Vec<usize>) -> Fixed {
        // A pair may begin with the last.
        let n = ends.last().map_or(0, |end| end + 1);
        let dark = || std::array::from_fn(|_| vec![0; n]);
        Fixed { steps: vec![[0.0; 3]; ends.len()], ends, coarse: dark(), rest: dark(), has_rest: false }
    }

    /// Takes on the light. Does not allocate.
    ///
    /// # Panics
    /// When a colour has fewer entries.
    pub fn set(&mut self, light: [&[f32]; 3], has_rest: bool) {
        self.has_rest = has_rest;
        let mut first = 0;
        for (&end, steps) in self.ends.iter().zip(&mut self.steps) {
            for (c, light) in light.into_iter().enumerate() {
                let light = &light[first..end];
                let step = light.iter().fold(0.0f32, |a, x| a.max(x.abs())) / WHOLE;
                steps[c] = step;
                let per_step = if step > f32::MIN_POSITIVE { 1.0 / step } else { 0.0 };
                let coarse = &mut self.coarse[c][first..end];
                coarse.iter_mut().zip(light).for_each(|(to, x)| *to = round(x * per_step));
                if has_rest {
                    let rest = self.rest[c][first..end].iter_mut();
                    for ((to, coarse), x) in rest.zip(coarse).zip(light) {
                        *to = round((x * per_step - f32::from(*coarse)) * WHOLE);
                    }
                }
            }
            first = end;
        }
    }

    /// Steps of a section.
    pub fn steps(&self, section: usize) -> [f32; 3] {
        self.steps[section]
    }

    /// Whole steps, and parts of them where those count.
    pub fn parts(&self) -> (Planes<'_>, Option<Planes<'_>>) {
        let [coarse, rest] = [&self.coarse, &self.rest].map(|planes| planes.each_ref().map(Vec::as_slice));
        (coarse, self.has_rest.then_some(rest))
    }
}

/// Whether some entries are so bright that others need more than their coarse part.
pub fn has_rest(light: [&[f32]; 3]) -> bool {
    light.iter().any(|light| {
        let (largest, sum) = light.iter().fold((0.0f32, 0.0), |(largest, sum), x| {
            let x = x.abs();
            (largest.max(x), sum + x)
        });
        largest * light.len() as f32 > BRIGHTEST * sum
    })
}

/// To the nearest, of at most [`WHOLE`] to either side.
fn round(x: f32) -> i16 {
    // Added to it, a float of this size keeps nothing below 1.
    const SHIFT: f32 = 12_582_912.0;
    ((x + SHIFT).to_bits() as i32).wrapping_sub(SHIFT.to_bits() as i32) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_parts_are_the_light_to_32_bits() {
        let light: Vec<f32> = (0..300).map(|i| ((i * i) as f32 * 0.37).sin() * 1.7f32.powi(i / 20)).collect();
        let mut fixed = Fixed::new(vec![100, 300]);
        fixed.set([&light, &light[..], &vec![0.0; 300]], true);
        let (coarse, rest) = fixed.parts();
        let rest = rest.expect("asked for");
        for (e, x) in light.iter().enumerate() {
            let step = fixed.steps(usize::from(e >= 100))[1];
            let whole = f32::from(coarse[1][e]);
            assert!((step * whole - x).abs() <= 0.5001 * step, "{e}");
            let all = step * (whole + f32::from(rest[1][e]) / WHOLE);
            // A float has 24 bits, of the largest and of itself.
            assert!((all - x).abs() <= 3e-7 * step * WHOLE, "{e}: {all} {x}");
            assert_eq!(coarse[2][e], 0, "dark");
        }
        assert_eq!(coarse[0].len(), 301);
    }

    #[test]
    fn rest_counts_beside_what_is_far_brighter() {
        let mut light = vec![1.0f32; 1000];
        assert!(!has_rest([&light, &light, &light]));
        light[7] = 1e4;
        assert!(has_rest([&[1.0], &light, &[1.0]]));
        assert!(!has_rest([&[0.0; 9], &[0.0; 9], &[0.0; 9]]), "dark");
    }
}
