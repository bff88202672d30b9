//! Lamps and blockers as people type them; what is wrong is pointed at.

use anyhow::{Result, bail, ensure};
use glam::Vec3;
use lunette_relight::lobe::Lamp;

/// The forms, for messages.
const LAMP: &str = "x,y,z,radius,L or x,y,z:x,y,z,radius,L, L one number or r,g,b";
const BLOCKER: &str = "SCENE, SCENE@x,y,z[,turn[,scale]] or SCENE@x,y,z[,turn[,scale]]:x,y,z[,turn]";

/// Metres beyond which a number is a slip of the pen, and radiances likewise.
const MOST: f32 = 1e9;

/// A lamp and its straight way.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingLamp {
    /// In the first frame.
    pub lamp: Lamp,
    /// Centre in the last frame.
    pub to: Vec3,
}

/// Where a body stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Of the mesh's origin, metres.
    pub position: Vec3,
    /// About the vertical, degrees clockwise seen from above.
    pub turn: f32,
}

/// A body by its scene's name, and its way.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingBody {
    pub scene: String,
    pub scale: f32,
    pub from: Place,
    pub to: Place,
}

/// `x,y,z[:x,y,z],radius,L`
pub fn lamp(text: &str) -> Result<MovingLamp> {
    let spec = Spec { option: "--lamp", text };
    let (from, rest) = match text.split_once(':') {
        Some((from, _)) => (Some(spec.numbers(0, from)?), from.len() + 1),
        None => (None, 0),
    };
    let numbers = spec.numbers(rest, &text[rest..])?;
    let counts = |n: &[Number]| matches!(n.len(), 5 | 7);
    if !counts(&numbers) || from.as_ref().is_some_and(|f| f.len() != 3) {
        let found = numbers.len() + from.as_ref().map_or(0, Vec::len);
        return spec.fail(0, &format!("{found} numbers where the form is {LAMP}"));
    }
    let to = vector(&numbers[..3]);
    let radius = &numbers[3];
    if radius.value <= 0.0 {
        return spec.fail(radius.column, &format!("radius {} must be above 0", radius.text));
    }
    if let Some(n) = numbers[4..].iter().find(|n| n.value < 0.0) {
        return spec.fail(n.column, &format!("radiance {} must be 0 or more", n.text));
    }
    let radiance = if numbers.len() == 7 { vector(&numbers[4..]) } else { Vec3::splat(numbers[4].value) };
    let centre = from.map_or(to, |from| vector(&from));
    let lamp = Lamp::new(centre, radius.value, radiance).map_err(|e| anyhow::anyhow!("--lamp: {e}"))?;
    Ok(MovingLamp { lamp, to })
}

/// `SCENE[@x,y,z[,turn[,scale]][:x,y,z[,turn]]]`
pub fn blocker(text: &str) -> Result<MovingBody> {
    let spec = Spec { option: "--blocker", text };
    let (scene, place) = match text.rsplit_once('@') {
        Some((scene, place)) => (scene, Some(place)),
        None => (text, None),
    };
    ensure!(!scene.trim().is_empty(), "--blocker, column 1: a scene is missing here (in \"{text}\")");
    let still =
        MovingBody { scene: scene.to_string(), scale: 1.0, from: Place::default(), to: Place::default() };
    let Some(place) = place else { return Ok(still) };
    let start = scene.len() + 1;
    let (from, to) = match place.split_once(':') {
        Some((from, to)) => (from, Some((start + from.len() + 1, to))),
        None => (place, None),
    };
    let first = spec.numbers(start, from)?;
    if !(3..=5).contains(&first.len()) {
        return spec.fail(start, &format!("{} numbers where the form is {BLOCKER}", first.len()));
    }
    let scale = first.get(4).map_or(1.0, |n| n.value);
    if let Some(n) = first.get(4).filter(|n| n.value <= 0.0) {
        return spec.fail(n.column, &format!("scale {} must be above 0", n.text));
    }
    let from = at(&first);
    let to = match to {
        None => from,
        Some((column, to)) => {
            let last = spec.numbers(column, to)?;
            if !(3..=4).contains(&last.len()) {
                return spec.fail(column, &format!("{} numbers where the form is {BLOCKER}", last.len()));
            }
            Place { turn: last.get(3).map_or(from.turn, |n| n.value), ..at(&last) }
        }
    };
    Ok(MovingBody { scale, from, to, ..still })
}

fn at(numbers: &[Number]) -> Place {
    Place { position: vector(&numbers[..3]), turn: numbers.get(3).map_or(0.0, |n| n.value) }
}

fn vector(numbers: &[Number]) -> Vec3 {
    Vec3::new(numbers[0].value, numbers[1].value, numbers[2].value)
}

struct Number<'a> {
    value: f32,
    text: &'a str,
    /// Bytes before it.
    column: usize,
}

/// The text of an option, for messages.
struct Spec<'a> {
    option: &'static str,
    text: &'a str,
}

impl Spec<'_> {
    fn fail<T>(&self, column: usize, what: &str) -> Result<T> {
        let column = self.text[..column].chars().count() + 1;
        bail!("{}, column {column}: {what} (in \"{}\")", self.option, self.text.escape_debug())
    }

    /// Numbers joined by commas; `part` begins at byte `start` of the text.
    fn numbers<'a>(&self, start: usize, part: &'a str) -> Result<Vec<Number<'a>>> {
        let mut column = start;
        let mut numbers = Vec::new();
        for text in part.split(',') {
            match text.trim().parse::<f32>() {
                Ok(value) if value.abs() <= MOST => numbers.push(Number { value, text, column }),
                Ok(value) if !value.is_nan() => {
                    return self.fail(column, &format!("{text} is not in -{MOST:e}..={MOST:e}"));
                }
                _ => return self.fail(column, &format!("{text:?} is not a number")),
            }
            column += text.len() + 1;
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_stand_or_move() {
        let still = lamp("1,2,-3,0.5,7,8,9").unwrap();
        assert_eq!(still.lamp, Lamp::new(Vec3::new(1.0, 2.0, -3.0), 0.5, Vec3::new(7.0, 8.0, 9.0)).unwrap());
        assert_eq!(still.to, still.lamp.centre);
        let moving = lamp("1,2,3: 4, 5,6,0.5,7").unwrap();
        assert_eq!((moving.lamp.centre, moving.to), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)));
        assert_eq!(moving.lamp.radiance, Vec3::splat(7.0));
    }

    #[test]
    fn blockers_keep_the_colons_of_their_scene() {
        let body = blocker("rabbit:height=2@1,2,3,90,0.5:4,5,6").unwrap();
        assert_eq!((body.scene.as_str(), body.scale), ("rabbit:height=2", 0.5));
        assert_eq!(body.from, Place { position: Vec3::new(1.0, 2.0, 3.0), turn: 90.0 });
        assert_eq!(body.to, Place { position: Vec3::new(4.0, 5.0, 6.0), turn: 90.0 });
        assert_eq!(blocker("a@b/c.obj@0,0,0").unwrap().scene, "a@b/c.obj");
        assert_eq!(blocker("c.obj").unwrap().to, Place::default());
    }

    #[test]
    fn mistakes_are_pointed_at() {
        let column = |text: &str, parsed: Result<(), anyhow::Error>, column: usize| {
            let error = parsed.unwrap_err().to_string();
            assert!(error.contains(&format!("column {column}:")) && !error.contains('\n'), "{text}: {error}");
        };
        for (text, at) in [
            ("", 1),
            ("1,2", 1),
            ("1,2,3,0,1", 7),
            ("1,2,3,-1,1", 7),
            ("1,2,3,nan,1", 7),
            ("1,2,x,1,1", 5),
            ("1,2,3,1,1,1", 1),
            ("1,2,3,1,-1", 9),
            ("1,2:4,5,6,1,1", 1),
            ("1,2,3:4,5,6,inf,1", 13),
            ("é,2,3,1,1", 1),
        ] {
            column(text, lamp(text).map(|_| ()), at);
        }
        for (text, at) in [
            ("@1,2,3", 1),
            ("a@1,2", 3),
            ("a@1,y,3", 5),
            ("a@1,2,3,0,0", 11),
            ("a@1,2,3:4,5", 9),
            ("ä@1,2,3:4,5,q", 13),
        ] {
            column(text, blocker(text).map(|_| ()), at);
        }
    }
}
