//! The text form of a light.
//!
//! Terms joined by ` + ` (a plus with a space on both sides: without spaces it belongs to a file name or a
//! number), each one of
//!
//! | term | meaning |
//! |---|---|
//! | `uniform[:L]` | the same radiance everywhere, 1 if not given |
//! | `cie-overcast[:L]` | the CIE overcast sky of zenith radiance L |
//! | `cap:x,y,z,radius,L` | a disc around the direction (x,y,z), radius in radians |
//! | `point:x,y,z,radius,L` | a glowing sphere at (x,y,z), metres, as seen from the scene's centre |
//! | `spot:x,y,z,tx,ty,tz,angle,radius,L` | such a sphere that shines towards (tx,ty,tz) in a cone of half-angle `angle` degrees |
//! | `sky:azimuth,elevation[,turbidity]` | the Hosek-Wilkie sky with its sun; degrees |
//! | `FILE.exr`, `FILE.hdr` | an equirect picture; `:rotate=D` turns it clockwise by D degrees as seen from above, `:scale=F` makes it F times as bright, `:rotate=D,scale=F` both |
//!
//! where L is one number (grey) or three (r,g,b). Every number is checked: no NaN, no infinity, nothing
//! negative where that means nothing.

use std::fmt;
use std::path::Path;

use glam::{Quat, Vec3};

use super::sky::{self, SkyError};
use super::{Cap, CieOvercast, Equirect, Light, Sky, Source};

/// What parsing needs to know of the world.
pub struct ParseContext<'a> {
    /// Reads an `.exr` or `.hdr` file; the error is one line.
    pub load_image: &'a mut dyn FnMut(&Path) -> Result<Equirect, String>,
    /// Where point and spot lights are seen from: the scene's centre, metres.
    pub centre: Vec3,
    /// Written by parsing: distance of the nearest point or spot light from `centre` (metres; infinite
    /// without one), to be held against the scene's size with [`near_ratio`](super::near_ratio).
    pub nearest_lamp: f32,
}

impl<'a> ParseContext<'a> {
    /// A context with the scene around the origin.
    pub fn new(load_image: &'a mut dyn FnMut(&Path) -> Result<Equirect, String>) -> ParseContext<'a> {
        ParseContext { load_image, centre: Vec3::ZERO, nearest_lamp: f32::INFINITY }
    }
}

/// Where and why a light's text does not parse. Displays as one line that points at the place.
#[derive(Clone, Debug, PartialEq)]
pub struct ParseError {
    /// The whole text.
    pub spec: String,
    /// Character within it, from 1.
    pub column: usize,
    /// What is wrong there.
    pub problem: Problem,
}

/// What can be wrong in a light's text.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Problem {
    /// Nothing where a light should be.
    Empty,
    /// No light has this name.
    UnknownKind(String),
    /// The list of numbers is too short or too long.
    Count {
        /// The form that was expected.
        form: &'static str,
        /// How many numbers there are.
        found: usize,
    },
    /// Not a number, or NaN, or infinite.
    NotANumber {
        /// What the number is for.
        name: &'static str,
        /// What stands there.
        text: String,
    },
    /// A number outside of what makes sense.
    OutOfRange {
        /// What the number is for.
        name: &'static str,
        /// What stands there.
        text: String,
        /// The range, in words.
        range: &'static str,
    },
    /// A direction without length, or a lamp in or on the scene's centre.
    NoDirection(&'static str),
    /// A picture's option that does not exist.
    UnknownOption(String),
    /// The picture could not be loaded; the loader's own line.
    Image(String),
    /// There is no such sky.
    Sky(SkyError),
}

/// Radiance above this is taken for a slip of the pen: a million times the sun's.
const MAX_RADIANCE: f64 = 1e12;

/// Lengths beyond this, in metres, are taken for a slip of the pen: two light years.
const MAX_LENGTH: f64 = 2e16;

/// Fraction of a spot's half-angle, from its axis, that has full brightness; from there it fades out
/// smoothly.
const SPOT_CORE: f32 = 0.8;

impl Light {
    /// Reads the text form of a light (see the table in `parse.rs`, repeated in the manual).
    ///
    /// # Errors
    /// When a term is unknown, a number is missing, malformed or absurd, or a picture does not load.
    pub fn parse(spec: &str, context: &mut ParseContext) -> Result<Light, ParseError> {
        let sources = terms(spec)
            .into_iter()
            .map(|(start, term)| parse_term(Text { spec, start, text: term }, context))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Light { sources: sources.into_iter().flatten().collect() })
    }
}

/// A piece of the whole text that knows where it stands.
#[derive(Clone, Copy)]
struct Text<'a> {
    spec: &'a str,
    /// Byte offset of `text` in `spec`.
    start: usize,
    text: &'a str,
}

impl<'a> Text<'a> {
    fn error(&self, problem: Problem) -> ParseError {
        let column = self.spec[..self.start].chars().count() + 1;
        ParseError { spec: self.spec.to_owned(), column, problem }
    }

    /// The same text without the spaces around it.
    fn trimmed(self) -> Text<'a> {
        let lead = self.text.len() - self.text.trim_start().len();
        Text { start: self.start + lead, text: self.text.trim(), ..self }
    }

    /// Before and after the byte `at`, which is left out.
    fn cut(self, at: usize) -> (Text<'a>, Text<'a>) {
        let (head, tail) = (&self.text[..at], &self.text[at + 1..]);
        (Text { text: head, ..self }, Text { start: self.start + at + 1, text: tail, ..self })
    }

    /// The pieces between commas.
    fn split_commas(self) -> Vec<Text<'a>> {
        let mut pieces = Vec::new();
        let mut rest = self;
        while let Some(comma) = rest.text.find(',') {
            let (head, tail) = rest.cut(comma);
            pieces.push(head.trimmed());
            rest = tail;
        }
        pieces.push(rest.trimmed());
        pieces
    }

    fn number(self, name: &'static str) -> Result<f64, ParseError> {
        let value = self.text.parse::<f64>().ok().filter(|v| v.is_finite());
        value.ok_or_else(|| self.error(Problem::NotANumber { name, text: self.text.to_owned() }))
    }

    fn number_where(self, name: &'static str, range: Range) -> Result<f32, ParseError> {
        let value = self.number(name)?;
        let is_positive_enough = value > range.above || (range.includes_lower && value == range.above);
        if is_positive_enough && value <= range.most {
            return Ok(value as f32);
        }
        Err(self.error(Problem::OutOfRange { name, text: self.text.to_owned(), range: range.words }))
    }
}

/// Which numbers are allowed.
#[derive(Clone, Copy)]
struct Range {
    above: f64,
    includes_lower: bool,
    most: f64,
    words: &'static str,
}

const RADIANCE: Range = Range { above: 0.0, includes_lower: true, most: MAX_RADIANCE, words: "0 to 1e12" };
const SCALE: Range = Range { words: "0 to 1e12", ..RADIANCE };
const CAP_RADIUS: Range = Range {
    above: 0.0,
    includes_lower: false,
    most: std::f64::consts::PI,
    words: "more than 0 and at most pi radians",
};
const LENGTH: Range = Range {
    above: 0.0,
    includes_lower: false,
    most: MAX_LENGTH,
    words: "more than 0 and at most 2e16 metres",
};
const COORDINATE: Range =
    Range { above: -MAX_LENGTH, includes_lower: true, most: MAX_LENGTH, words: "-2e16 to 2e16" };
const SPOT_ANGLE: Range =
    Range { above: 0.0, includes_lower: false, most: 180.0, words: "more than 0 and at most 180 degrees" };
const AZIMUTH: Range =
    Range { above: -360.0, includes_lower: true, most: 360.0, words: "-360 to 360 degrees" };
const ELEVATION: Range = Range { above: -90.0, includes_lower: true, most: 90.0, words: "-90 to 90 degrees" };
const TURBIDITY: Range = Range { above: 1.0, includes_lower: true, most: 10.0, words: "1 to 10" };

/// The terms between separating pluses with their byte offsets, untrimmed.
fn terms(spec: &str) -> Vec<(usize, &str)> {
    let bytes = spec.as_bytes();
    let is_space = |i: usize| bytes.get(i).is_none_or(u8::is_ascii_whitespace);
    let mut found = Vec::new();
    let mut start = 0;
    for (i, _) in spec.match_indices('+') {
        if (i == 0 || is_space(i - 1)) && is_space(i + 1) {
            found.push((start, &spec[start..i]));
            start = i + 1;
        }
    }
    found.push((start, &spec[start..]));
    found
}

/// One term; `None` for a spot that shines past the scene.
fn parse_term(term: Text, context: &mut ParseContext) -> Result<Option<Source>, ParseError> {
    let term = term.trimmed();
    if term.text.is_empty() {
        return Err(term.error(Problem::Empty));
    }
    if let Some((file, options)) = split_file(term) {
        return parse_image(file, options, context).map(Some);
    }
    let (kind, numbers) = match term.text.find(':') {
        Some(colon) => {
            let (kind, rest) = term.cut(colon);
            (kind, rest.split_commas())
        }
        None => (term, Vec::new()),
    };
    match kind.text.trim_end() {
        "uniform" => {
            parse_grey(term, &numbers, "uniform[:L] or uniform:r,g,b").map(Source::Uniform).map(Some)
        }
        "cie-overcast" => parse_grey(term, &numbers, "cie-overcast[:L] or cie-overcast:r,g,b")
            .map(|zenith| Some(Source::CieOvercast(CieOvercast::new(zenith)))),
        "cap" => parse_cap(term, &numbers).map(|cap| Some(Source::Cap(cap))),
        "point" => parse_point(term, &numbers, context).map(|cap| Some(Source::Cap(cap))),
        "spot" => parse_spot(term, &numbers, context).map(|cap| cap.map(Source::Cap)),
        "sky" => parse_sky(term, &numbers).map(|sky| Some(Source::Sky(sky))),
        other => Err(kind.error(Problem::UnknownKind(other.to_owned()))),
    }
}

/// A radiance that may be left out: then 1.
fn parse_grey(term: Text, numbers: &[Text], form: &'static str) -> Result<Vec3, ParseError> {
    if numbers.is_empty() { Ok(Vec3::ONE) } else { parse_radiance(term, numbers, 0, form) }
}

/// The radiance that ends the list from `first` on: one number or three.
fn parse_radiance(
    term: Text,
    numbers: &[Text],
    first: usize,
    form: &'static str,
) -> Result<Vec3, ParseError> {
    let channel = |i: usize| numbers[first + i].number_where("radiance", RADIANCE);
    match numbers.len().checked_sub(first) {
        Some(1) => Ok(Vec3::splat(channel(0)?)),
        Some(3) => Ok(Vec3::new(channel(0)?, channel(1)?, channel(2)?)),
        _ => Err(term.error(Problem::Count { form, found: numbers.len() })),
    }
}

/// Three coordinates from `first` on. The caller has checked the count.
fn parse_vector(numbers: &[Text], first: usize) -> Result<Vec3, ParseError> {
    let coordinate = |i: usize| numbers[first + i].number_where("coordinate", COORDINATE);
    Ok(Vec3::new(coordinate(0)?, coordinate(1)?, coordinate(2)?))
}

fn check_count(
    term: Text,
    numbers: &[Text],
    n_before_radiance: usize,
    form: &'static str,
) -> Result<(), ParseError> {
    let fits = [n_before_radiance + 1, n_before_radiance + 3].contains(&numbers.len());
    if fits { Ok(()) } else { Err(term.error(Problem::Count { form, found: numbers.len() })) }
}

fn parse_cap(term: Text, numbers: &[Text]) -> Result<Cap, ParseError> {
    let form = "cap:x,y,z,radius,L or cap:x,y,z,radius,r,g,b";
    check_count(term, numbers, 4, form)?;
    let axis = unit(parse_vector(numbers, 0)?).ok_or_else(|| {
        numbers[0].error(Problem::NoDirection("the direction 0,0,0 of the cap has no length"))
    })?;
    let radius = numbers[3].number_where("radius", CAP_RADIUS)?.min(std::f32::consts::PI);
    Ok(Cap { axis, radius, radiance: parse_radiance(term, numbers, 4, form)? })
}

fn parse_point(term: Text, numbers: &[Text], context: &mut ParseContext) -> Result<Cap, ParseError> {
    let form = "point:x,y,z,radius,L or point:x,y,z,radius,r,g,b";
    check_count(term, numbers, 4, form)?;
    let position = parse_vector(numbers, 0)?;
    let radius = numbers[3].number_where("radius", LENGTH)?;
    let radiance = parse_radiance(term, numbers, 4, form)?;
    lamp(numbers[0], position, radius, radiance, context)
}

fn parse_spot(term: Text, numbers: &[Text], context: &mut ParseContext) -> Result<Option<Cap>, ParseError> {
    let form = "spot:x,y,z,tx,ty,tz,angle,radius,L or spot:x,y,z,tx,ty,tz,angle,radius,r,g,b";
    check_count(term, numbers, 8, form)?;
    let position = parse_vector(numbers, 0)?;
    let aim = unit(parse_vector(numbers, 3)? - position)
        .ok_or_else(|| numbers[3].error(Problem::NoDirection("the spot aims at its own position")))?;
    let half_angle = numbers[6].number_where("angle", SPOT_ANGLE)?.to_radians();
    let radius = numbers[7].number_where("radius", LENGTH)?;
    let radiance = parse_radiance(term, numbers, 8, form)?;
    let cap = lamp(numbers[0], position, radius, radiance, context)?;
    let off_axis = aim.angle_between(-cap.axis);
    let fade = ((half_angle - off_axis) / ((1.0 - SPOT_CORE) * half_angle)).clamp(0.0, 1.0);
    let brightness = fade * fade * (3.0 - 2.0 * fade);
    Ok((brightness > 0.0).then_some(Cap { radiance: cap.radiance * brightness, ..cap }))
}

/// The cap of a glowing sphere as seen from the scene's centre.
fn lamp(
    place: Text,
    position: Vec3,
    radius: f32,
    radiance: Vec3,
    context: &mut ParseContext,
) -> Result<Cap, ParseError> {
    let cap = Cap::of_sphere(position, radius, radiance, context.centre)
        .filter(|cap| cap.radius > 0.0 && cap.axis.is_normalized())
        .ok_or_else(|| {
            place.error(Problem::NoDirection("the lamp's sphere holds the scene's centre, or is too far"))
        })?;
    context.nearest_lamp = context.nearest_lamp.min(position.distance(context.centre));
    Ok(cap)
}

fn parse_sky(term: Text, numbers: &[Text]) -> Result<Sky, ParseError> {
    if !(2..=3).contains(&numbers.len()) {
        let form = "sky:azimuth,elevation[,turbidity]";
        return Err(term.error(Problem::Count { form, found: numbers.len() }));
    }
    let azimuth = numbers[0].number_where("azimuth", AZIMUTH)?.to_radians();
    let elevation = numbers[1].number_where("elevation", ELEVATION)?.to_radians();
    let turbidity = match numbers.get(2) {
        Some(number) => number.number_where("turbidity", TURBIDITY)?,
        None => sky::DEFAULT_TURBIDITY,
    };
    let right_angle = std::f32::consts::FRAC_PI_2;
    Sky::new(azimuth, elevation.clamp(-right_angle, right_angle), turbidity)
        .map_err(|error| term.error(Problem::Sky(error)))
}

/// File name and options of a term that names a picture.
fn split_file(term: Text) -> Option<(Text, Option<Text>)> {
    let lower = term.text.to_ascii_lowercase();
    if lower.ends_with(".exr") || lower.ends_with(".hdr") {
        return Some((term, None));
    }
    let colon = [".exr:", ".hdr:"].iter().filter_map(|end| lower.rfind(end)).max()? + 4;
    let (file, options) = term.cut(colon);
    Some((file, Some(options)))
}

fn parse_image(file: Text, options: Option<Text>, context: &mut ParseContext) -> Result<Source, ParseError> {
    let (mut turn, mut scale) = (0.0, 1.0);
    for option in options.map(Text::split_commas).unwrap_or_default() {
        let unknown = || option.error(Problem::UnknownOption(option.text.to_owned()));
        let (name, value) = option.cut(option.text.find('=').ok_or_else(unknown)?);
        match name.text.trim() {
            "rotate" => turn = value.trimmed().number_where("rotate", AZIMUTH)?,
            "scale" => scale = value.trimmed().number_where("scale", SCALE)?,
            _ => return Err(unknown()),
        }
    }
    let image =
        (context.load_image)(Path::new(file.text)).map_err(|line| file.error(Problem::Image(line)))?;
    // Compass angles are clockwise as seen from above, rotations about +Y are the other way.
    Ok(Source::Equirect(image.rotated(Quat::from_rotation_y(-turn.to_radians())).scaled(scale)))
}

/// `v` with length 1, also where its squared length would overflow or vanish.
fn unit(v: Vec3) -> Option<Vec3> {
    let largest = v.abs().max_element();
    (largest > 0.0).then(|| (v / largest).normalize())
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let spec = self.spec.escape_debug();
        write!(f, "light, column {}: {} (in \"{spec}\")", self.column, self.problem)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Problem::Empty => write!(f, "a light is missing here"),
            Problem::UnknownKind(kind) => write!(
                f,
                "{kind:?} is no light: use uniform, cie-overcast, cap, point, spot, sky, or a file ending in \
                 .exr or .hdr"
            ),
            Problem::Count { form, found } => write!(f, "{found} numbers where the form is {form}"),
            Problem::NotANumber { name, text } if text.contains('+') => {
                write!(f, "{name} {text:?} is not a number; to join two lights put spaces around the +")
            }
            Problem::NotANumber { name, text } => write!(f, "{name} {text:?} is not a number"),
            Problem::OutOfRange { name, text, range } => write!(f, "{name} {text} must be {range}"),
            Problem::NoDirection(why) => f.write_str(why),
            Problem::UnknownOption(text) => {
                write!(f, "option {text:?} is neither rotate=DEGREES nor scale=FACTOR")
            }
            Problem::Image(line) => f.write_str(line),
            Problem::Sky(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for ParseError {}
