//! `NAME[:key=value,key=value]`: which built-in scene, and its parameters.

use super::{BUILTINS, Builtin};
use crate::Error;

/// A number that a built-in scene can be asked for.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// As in the spec.
    pub name: &'static str,
    /// What it is, with its unit.
    pub what: &'static str,
    /// What it is where the spec does not say; `None` where the scene then decides itself.
    pub default: Option<f32>,
    /// Smallest value.
    pub low: f32,
    /// Largest value.
    pub high: f32,
    /// Which values between these there are.
    pub kind: Kind,
}

/// Which numbers a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// All.
    Real,
    /// Whole numbers.
    Whole,
}

/// The values of all parameters of a scene.
#[derive(Debug)]
pub struct Values {
    parameters: &'static [Parameter],
    value: Vec<Option<f32>>,
}

impl Values {
    /// The value of a parameter that has a default.
    ///
    /// # Panics
    /// Where the scene has no such parameter.
    pub fn get(&self, name: &str) -> f32 {
        self.find(name).expect("the scene declares this parameter with a default")
    }

    /// The value of a whole-number parameter.
    ///
    /// # Panics
    /// As [`Values::get`].
    pub fn count(&self, name: &str) -> usize {
        self.get(name) as usize
    }

    /// The value of a parameter, if the scene has it and it has one.
    pub fn find(&self, name: &str) -> Option<f32> {
        let i = self.parameters.iter().position(|p| p.name == name)?;
        self.value[i]
    }
}

/// The scene that a spec names and the values that it gives.
///
/// # Errors
/// An unknown name or parameter, a value that is no number, out of range or not whole: each says what there is.
pub fn parse(spec: &str) -> Result<(&'static Builtin, Values), Error> {
    let (name, rest) = spec.split_once(':').unwrap_or((spec, ""));
    let builtin = BUILTINS.iter().find(|b| b.name == name.trim()).ok_or_else(|| {
        let names: Vec<&str> = BUILTINS.iter().map(|b| b.name).collect();
        wrong(format!("no built-in scene `{}`{}", name.trim(), choices(name.trim(), &names)))
    })?;
    let parameters = builtin.parameters;
    let mut values = Values { parameters, value: parameters.iter().map(|p| p.default).collect() };
    for setting in rest.split(',').map(str::trim).filter(|s| !s.is_empty()) {
        let (i, value) = set(builtin, setting)?;
        values.value[i] = Some(value);
    }
    Ok((builtin, values))
}

fn set(builtin: &Builtin, setting: &str) -> Result<(usize, f32), Error> {
    let scene = builtin.name;
    let Some((key, value)) = setting.split_once('=') else {
        return Err(wrong(format!("{scene}: `{setting}` should read `name=value`")));
    };
    let (key, value) = (key.trim(), value.trim());
    let Some(i) = builtin.parameters.iter().position(|p| p.name == key) else {
        let names: Vec<&str> = builtin.parameters.iter().map(|p| p.name).collect();
        return Err(wrong(format!("{scene} has no parameter `{key}`{}", choices(key, &names))));
    };
    let p = &builtin.parameters[i];
    let kind = if p.kind == Kind::Whole { "a whole number" } else { "a number" };
    let number = value.parse().ok().filter(|x: &f32| (p.low..=p.high).contains(x));
    let number = number.filter(|x| p.kind == Kind::Real || x.fract() == 0.0);
    let number = number.ok_or_else(|| {
        let (low, high) = (p.low, p.high);
        wrong(format!("{scene}: {key}={value} should be {kind} from {low} to {high} ({})", p.what))
    })?;
    Ok((i, number))
}

pub(super) fn wrong(what: String) -> Error {
    Error::Builtin { what }
}

/// "; did you mean `x`? There are: x, y, z", the guess only where it is a near one.
fn choices(given: &str, names: &[&str]) -> String {
    let nearest = names.iter().map(|name| (distance(given, name), name)).min();
    // Half of the letters wrong is no near miss.
    let guess = nearest.filter(|(d, name)| 2 * d <= name.len().max(2));
    let guess = guess.map(|(_, name)| format!("; did you mean `{name}`?")).unwrap_or_else(|| ";".into());
    format!("{guess} There are: {}", names.join(", "))
}

/// Edit distance: letters to insert, drop or change.
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.bytes().enumerate() {
            let change = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
