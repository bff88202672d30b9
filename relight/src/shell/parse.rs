//! The text form of a portal's material.

use std::fmt;

use super::Material;

/// Where and why a material's text does not parse. Displays as one line that points at the place.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialError {
    /// The whole text.
    pub spec: String,
    /// Character within it, from 1.
    pub column: usize,
    /// What is wrong there.
    pub problem: MaterialProblem,
}

/// What can be wrong in a material's text.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum MaterialProblem {
    /// No `=`, or nothing before it.
    NoName,
    /// No material has this name.
    Unknown(String),
    /// `tint` needs three numbers, `frosted` one, the others none.
    Count(&'static str),
    /// Not a number, or NaN, or infinite.
    NotANumber(String),
    /// A share below 0, or a blur outside of 0..=π.
    OutOfRange(String),
}

/// Reads `NAME=PART[+PART...]`: the portal's name (which may hold a `=` itself) and what its parts come to.
///
/// # Errors
/// When the name, a part or a number is missing or wrong.
pub fn parse_material(spec: &str) -> Result<(String, Material), MaterialError> {
    let fail = |at: usize, problem| {
        Err(MaterialError { spec: spec.to_string(), column: spec[..at].chars().count() + 1, problem })
    };
    let Some(equals) = spec.rfind('=') else { return fail(0, MaterialProblem::NoName) };
    let name = spec[..equals].trim();
    if name.is_empty() {
        return fail(0, MaterialProblem::NoName);
    }
    let mut material = Material::CLEAR;
    let mut at = equals + 1;
    for part in spec[at..].split('+') {
        let begin = at + part.len() - part.trim_start().len();
        if let Err((offset, problem)) = apply(part.trim(), &mut material) {
            return fail(begin + offset, problem);
        }
        at += part.len() + 1;
    }
    Ok((name.to_string(), material))
}

/// Adds a part to a material; an error says how many bytes into the part.
fn apply(part: &str, material: &mut Material) -> Result<(), (usize, MaterialProblem)> {
    let (kind, numbers) = match part.split_once(':') {
        Some((kind, rest)) => (kind.trim_end(), Some((kind.len() + 1, rest))),
        None => (part, None),
    };
    match (kind, numbers) {
        ("clear", None) => {}
        ("closed", None) => material.tint = [0.0; 3],
        ("tint", Some(list)) => {
            let tint: [f32; 3] = parse_numbers(list, "tint:r,g,b", f32::MAX)?;
            for (m, t) in material.tint.iter_mut().zip(tint) {
                *m *= t;
            }
        }
        ("frosted", Some(list)) => {
            let [frost] = parse_numbers(list, "frosted:radians", std::f32::consts::PI)?;
            // Two scatterings one after the other add their variances.
            material.frost = material.frost.hypot(frost).min(std::f32::consts::PI);
        }
        ("tint", None) => return Err((part.len(), MaterialProblem::Count("tint:r,g,b"))),
        ("frosted", None) => return Err((part.len(), MaterialProblem::Count("frosted:radians"))),
        ("clear" | "closed", Some((at, _))) => {
            return Err((at - 1, MaterialProblem::Count("clear or closed, without numbers")));
        }
        _ => return Err((0, MaterialProblem::Unknown(kind.to_string()))),
    }
    Ok(())
}

/// `N` numbers in 0..=`most`, joined by commas.
fn parse_numbers<const N: usize>(
    (start, list): (usize, &str),
    form: &'static str,
    most: f32,
) -> Result<[f32; N], (usize, MaterialProblem)> {
    if list.split(',').count() != N {
        return Err((start, MaterialProblem::Count(form)));
    }
    let mut numbers = [0.0; N];
    let mut at = start;
    for (number, text) in numbers.iter_mut().zip(list.split(',')) {
        let begin = at + text.len() - text.trim_start().len();
        let word = text.trim();
        *number = match word.parse::<f32>() {
            Ok(x) if x.is_finite() => x,
            _ => return Err((begin, MaterialProblem::NotANumber(word.to_string()))),
        };
        if !(0.0..=most).contains(number) {
            return Err((begin, MaterialProblem::OutOfRange(word.to_string())));
        }
        at += text.len() + 1;
    }
    Ok(numbers)
}

impl fmt::Display for MaterialError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let spec = self.spec.escape_debug();
        write!(f, "portal material, column {}: {} (in \"{spec}\")", self.column, self.problem)
    }
}

impl fmt::Display for MaterialProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MaterialProblem::NoName => write!(f, "the form is NAME=MATERIAL, as in glass=tint:1,0.8,0.6"),
            MaterialProblem::Unknown(kind) => {
                write!(f, "{kind:?} is no material: use clear, closed, tint:r,g,b or frosted:radians")
            }
            MaterialProblem::Count(form) => write!(f, "the form is {form}"),
            MaterialProblem::NotANumber(text) => write!(f, "{text:?} is not a number"),
            MaterialProblem::OutOfRange(text) => {
                write!(f, "{text} is out of range: a tint is at least 0, a blur 0 to 3.1416 radians")
            }
        }
    }
}

impl std::error::Error for MaterialError {}
