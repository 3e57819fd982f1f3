//! Which columns of a table are directions, which are reflectance, and which are neither.

use super::{Columns, is_direction};
use crate::channel::{self, Kind};
use crate::error::scattered::{ANGLES, List, Problem, VECTORS};
use crate::text::shorten;

/// Where the directions stand.
#[derive(Debug, Clone, Copy)]
pub(super) enum Directions {
    Angles([usize; 4]),
    Vectors([usize; 6]),
}

/// What each column is for.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) directions: Directions,
    /// Columns of reflectance, in the order asked for.
    pub(super) channels: Vec<usize>,
    /// The column of the wavelength in a table with one row per wavelength.
    pub(super) wavelength: Option<usize>,
    /// Columns left out, though nobody said so.
    pub(super) left_out: Vec<usize>,
}

impl Directions {
    pub(super) fn contains(&self, column: usize) -> bool {
        match self {
            Self::Angles(places) => places.contains(&column),
            Self::Vectors(places) => places.contains(&column),
        }
    }
}

impl Plan {
    pub(super) fn new(names: &[String], choice: &Columns) -> Result<Self, Problem> {
        let directions = find_directions(names)?;
        let mut rest: Vec<usize> = (0..names.len())
            .filter(|&column| !directions.contains(column))
            .collect();
        // Two spellings of one name would leave an angle among the values.
        if rest.iter().any(|&column| is_direction(&names[column])) {
            return Err(Problem::BothDirections);
        }
        for name in &choice.ignore {
            let Some(column) = find(name, names, &rest) else {
                return Err(unknown(name, names, &rest));
            };
            rest.retain(|&other| other != column);
        }
        if rest.is_empty() {
            return Err(Problem::NoValues);
        }
        let wavelength = wavelength(names, &rest, choice);
        rest.retain(|&column| Some(column) != wavelength);
        let (channels, left_out) = match wavelength {
            // Beside columns a list may name wavelengths, which are channels later.
            Some(_) => {
                let chosen = choice.channels.iter();
                let chosen: Vec<usize> = chosen.filter_map(|n| find(n, names, &rest)).collect();
                if chosen.is_empty() {
                    (undisputed(names, &rest)?, Vec::new())
                } else {
                    rest.retain(|column| !chosen.contains(column));
                    (chosen, rest)
                }
            }
            None if choice.channels.is_empty() => (undisputed(names, &rest)?, Vec::new()),
            None => {
                let mut chosen = Vec::with_capacity(choice.channels.len());
                for name in &choice.channels {
                    match find(name, names, &rest) {
                        Some(column) if !chosen.contains(&column) => chosen.push(column),
                        _ => return Err(unknown(name, names, &rest)),
                    }
                }
                rest.retain(|column| !chosen.contains(column));
                (chosen, rest)
            }
        };
        if wavelength.is_some() && channels.len() != 1 {
            let columns = List::of(channels.iter().map(|&c| &names[c]));
            return Err(Problem::SeveralPerWavelength { columns });
        }
        Ok(Self {
            directions,
            channels,
            wavelength,
            left_out,
        })
    }
}

fn find_directions(names: &[String]) -> Result<Directions, Problem> {
    let place = |name: &&str| names.iter().position(|c| c.eq_ignore_ascii_case(name));
    let (angles, vectors) = (ANGLES.map(|n| place(&n)), VECTORS.map(|n| place(&n)));
    let some = |places: &[Option<usize>]| places.iter().any(Option::is_some);
    if some(&angles) && some(&vectors) {
        return Err(Problem::BothDirections);
    }
    match (all(angles), all(vectors)) {
        (Some(places), _) => Ok(Directions::Angles(places)),
        (_, Some(places)) => Ok(Directions::Vectors(places)),
        _ => {
            let set: &[&'static str] = if some(&vectors) { &VECTORS } else { &ANGLES };
            let missing = set.iter().copied().filter(|name| place(name).is_none());
            Err(Problem::NoDirections {
                missing: missing.collect(),
            })
        }
    }
}

fn all<const N: usize>(places: [Option<usize>; N]) -> Option<[usize; N]> {
    let mut found = [0; N];
    for (to, from) in found.iter_mut().zip(places) {
        *to = from?;
    }
    Some(found)
}

/// The column that a name means: its own, or the only one of its colour or wavelength.
fn find(name: &str, names: &[String], among: &[usize]) -> Option<usize> {
    let own: Vec<String> = among.iter().map(|&column| names[column].clone()).collect();
    channel::place(name, &own).map(|place| among[place])
}

fn unknown(name: &str, names: &[String], among: &[usize]) -> Problem {
    Problem::NoSuchColumn {
        name: shorten(name),
        columns: List::of(among.iter().map(|&c| &names[c])),
    }
}

/// The column of wavelengths, if there is one beside a column of values.
fn wavelength(names: &[String], rest: &[usize], choice: &Columns) -> Option<usize> {
    let is = |&&column: &&usize| {
        let asked = choice.channels.iter().any(|n| n == &names[column]);
        !asked && channel::kind(&names[column]) == Kind::Wavelength
    };
    (rest.len() > 1).then(|| rest.iter().find(is).copied())?
}

/// All columns, where there is no doubt that they are reflectance.
///
/// A single column needs no name that says so, as long as its name says nothing else. Of several, a
/// name that says otherwise is an error; so is one that says nothing beside one that does say
/// reflectance. Where no name says anything, there is nothing to tell them by.
fn undisputed(names: &[String], rest: &[usize]) -> Result<Vec<usize>, Problem> {
    let kinds: Vec<Kind> = rest.iter().map(|&c| channel::kind(&names[c])).collect();
    if let &[only] = rest
        && !channel::is_one_word_for_something_else(&names[only])
    {
        return Ok(rest.to_vec());
    }
    let known = kinds.contains(&Kind::Value);
    let doubtful = rest.iter().zip(&kinds).filter(|(_, kind)| match kind {
        Kind::Value => false,
        Kind::NoValue | Kind::Wavelength => true,
        Kind::Unknown => known,
    });
    let doubtful: Vec<&String> = doubtful.map(|(&column, _)| &names[column]).collect();
    if doubtful.is_empty() {
        return Ok(rest.to_vec());
    }
    Err(Problem::NotReflectance {
        columns: List::of(doubtful),
    })
}
