//! Where a moving object is in each frame.

use crate::error::Error;
use glam::Vec3;

/// A straight way, covered at one speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track {
    /// Position in the first frame, metres.
    pub from: Vec3,
    /// Position in the last frame.
    pub to: Vec3,
}

impl Track {
    /// Reads `x,y,z:x,y,z`, in metres.
    ///
    /// # Errors
    /// [`Error::Options`] for anything else.
    pub fn parse(text: &str) -> Result<Track, Error> {
        let wrong = || Error::Options { what: format!("track '{text}': expected x,y,z:x,y,z in metres") };
        let (from, to) = text.split_once(':').ok_or_else(wrong)?;
        let point = |text: &str| {
            let mut numbers = text.split(',').map(|x| x.trim().parse::<f32>().ok().filter(|x| x.is_finite()));
            let p = Vec3::new(numbers.next()??, numbers.next()??, numbers.next()??);
            numbers.next().is_none().then_some(p)
        };
        Ok(Track { from: point(from).ok_or_else(wrong)?, to: point(to).ok_or_else(wrong)? })
    }

    /// Position in frame `i` of `n`; the way's beginning where there is only one.
    pub fn at(&self, i: usize, n: usize) -> Vec3 {
        self.from.lerp(self.to, if n > 1 { i as f32 / (n - 1) as f32 } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tracks_are_read_and_covered_evenly() {
        let track = Track::parse("0,1,-2.5: 4, 1,7.5").unwrap();
        let positions: Vec<Vec3> = (0..5).map(|i| track.at(i, 5)).collect();
        assert_eq!(positions[0], Vec3::new(0.0, 1.0, -2.5));
        assert_eq!(positions[2], Vec3::new(2.0, 1.0, 2.5));
        assert_eq!(positions[4], Vec3::new(4.0, 1.0, 7.5));
        assert_eq!(track.at(0, 1), track.from);
    }

    #[test]
    fn unreadable_tracks_are_refused() {
        for text in ["", "1,2,3", "1,2:3,4,5", "1,2,3,4:1,2,3", "1,2,x:1,2,3", "1,2,inf:1,2,3"] {
            assert_eq!(Track::parse(text).unwrap_err().to_string().lines().count(), 1, "{text}");
        }
    }
}
