//! Which columns of a table are directions, which are reflectance, and which are neither.

use ndarray::ArrayView1;

use super::angles::{self, Reader};
use super::names::{self, Direction, Named, Side};
use super::{Columns, Note};
use crate::channel::{self, Kind};
use crate::error::scattered::{ANGLES, AngleUnit, List, Problem, VECTORS};
use crate::text::shorten;

/// Where the directions stand.
#[derive(Debug, Clone, Copy)]
pub(super) enum Directions {
    Angles([Angle; 4]),
    Vectors([usize; 6]),
}

/// Where an angle is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Angle {
    Column(usize),
    /// In every row the same, in the unit of the file.
    Constant(f64),
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
    /// The unit that the columns' names say.
    pub(super) unit: Option<AngleUnit>,
    /// What was assumed of the names.
    pub(super) notes: Vec<Note>,
}

impl Directions {
    pub(super) fn contains(&self, column: usize) -> bool {
        match self {
            Self::Angles(angles) => angles
                .iter()
                .any(|angle| matches!(angle, Angle::Column(place) if *place == column)),
            Self::Vectors(places) => places.contains(&column),
        }
    }

    /// The directions of a row with these `cells`.
    pub(super) fn read(
        &self,
        reader: &mut Reader,
        cells: ArrayView1<'_, f64>,
    ) -> Result<angles::Found, Problem> {
        match self {
            Self::Angles(angles) => reader.angles(angles.map(|angle| match angle {
                Angle::Column(column) => cells[column],
                Angle::Constant(constant) => constant,
            })),
            Self::Vectors(columns) => reader.vectors(columns.map(|c| cells[c])),
        }
    }
}

impl Plan {
    /// Directions alone: all other columns are left out.
    pub(super) fn of_directions(names: &[String], choice: &Columns) -> Result<Self, Problem> {
        let ignored = |name: &String| {
            let mut ignore = choice.ignore.iter();
            ignore.any(|other| other.trim().eq_ignore_ascii_case(name.trim()))
        };
        let named: Vec<Option<Named>> = names
            .iter()
            .map(|name| names::of(name).filter(|_| !ignored(name)))
            .collect();
        let Found {
            directions,
            unit,
            notes,
        } = find_directions(names, &named, choice)?;
        Ok(Self {
            directions,
            channels: Vec::new(),
            wavelength: None,
            left_out: Vec::new(),
            unit,
            notes,
        })
    }

    pub(super) fn new(names: &[String], choice: &Columns) -> Result<Self, Problem> {
        let plan = Self::of_directions(names, choice)?;
        let directions = plan.directions;
        let mut rest: Vec<usize> = (0..names.len())
            .filter(|&column| !directions.contains(column))
            .collect();
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
        let named: Vec<&String> = channels.iter().map(|&column| &names[column]).collect();
        if let Some((first, second)) = channel::same_wavelength(&named) {
            return Err(Problem::SameWavelength {
                first: shorten(named[first]),
                second: shorten(named[second]),
            });
        }
        Ok(Self {
            channels,
            wavelength,
            left_out,
            ..plan
        })
    }
}

/// Where directions were found, and what their names say.
struct Found {
    directions: Directions,
    unit: Option<AngleUnit>,
    notes: Vec<Note>,
}

fn find_directions(
    names: &[String],
    named: &[Option<Named>],
    choice: &Columns,
) -> Result<Found, Problem> {
    let component = |named: &Option<Named>| match named {
        Some((Direction::Component(place), _)) => Some(*place),
        _ => None,
    };
    // An azimuth without a side may be anything beside vectors.
    let has_side =
        |(direction, _): &Named| matches!(direction, Direction::Theta(_) | Direction::Phi(_));
    let given = choice.angles.iter().any(Option::is_some);
    let mut places = [None; 6];
    for (column, named) in named.iter().enumerate() {
        // Two spellings of one name would leave a direction among the values.
        if let Some(place) = component(named)
            && places[place].replace(column).is_some()
        {
            return Err(Problem::BothDirections);
        }
    }
    if places.iter().all(Option::is_none) {
        if given || named.iter().any(Option::is_some) {
            return find_angles(names, named, choice);
        }
        let missing = ANGLES.to_vec();
        return Err(Problem::NoDirections { missing });
    }
    if given || named.iter().flatten().any(has_side) {
        return Err(Problem::BothDirections);
    }
    let Some(places) = all(places) else {
        let there = VECTORS.into_iter().zip(places);
        let missing = there
            .filter(|(_, place)| place.is_none())
            .map(|(name, _)| name);
        return Err(Problem::NoDirections {
            missing: missing.collect(),
        });
    };
    Ok(Found {
        directions: Directions::Vectors(places),
        unit: None,
        notes: Vec::new(),
    })
}

/// The columns of the four angles, and that of the difference of azimuths.
type Places = ([Option<usize>; 4], Option<usize>);

fn find_angles(
    names: &[String],
    named: &[Option<Named>],
    choice: &Columns,
) -> Result<Found, Problem> {
    let (places, difference) = places_of_angles(names, named, choice)?;
    let mut angles = [Angle::Constant(0.0); 4];
    let (mut missing, mut no_azimuth) = (Vec::new(), Vec::new());
    for place in 0..4 {
        let angle = ANGLES[place];
        match (places[place], choice.angles[place]) {
            (Some(column), Some(_)) => {
                return Err(Problem::AngleTwice {
                    angle,
                    column: shorten(&names[column]),
                });
            }
            (Some(column), None) => angles[place] = Angle::Column(column),
            (None, Some(constant)) => angles[place] = Angle::Constant(constant),
            (None, None) if place % 2 == 0 => missing.push(angle),
            (None, None) => no_azimuth.push(place),
        }
    }
    if !missing.is_empty() {
        return Err(Problem::NoDirections { missing });
    }
    let mut notes = Vec::new();
    notes.extend(other_names(names, &places));
    match difference {
        Some(column) if no_azimuth == [1, 3] => {
            angles[3] = Angle::Column(column);
            notes.push(Note::Difference {
                column: shorten(&names[column]),
            });
        }
        _ if !no_azimuth.is_empty() => {
            let absent = no_azimuth.iter().map(|&place| ANGLES[place].to_owned());
            let absent: Vec<String> = absent.collect();
            notes.push(Note::NoAzimuth {
                angles: List::of(&absent),
            });
        }
        _ => {}
    }
    Ok(Found {
        directions: Directions::Angles(angles),
        unit: one_unit(&angles, named)?,
        notes,
    })
}

/// Finds the column of each angle by its name; none may have two.
fn places_of_angles(
    names: &[String],
    named: &[Option<Named>],
    choice: &Columns,
) -> Result<Places, Problem> {
    let [theta_i, phi_i, theta_o, phi_o] = choice.angles.map(|angle| angle.is_some());
    let of = |side: Side| {
        let is = move |named: &Named| matches!(named.0, Direction::Theta(other) | Direction::Phi(other) if other == side);
        named.iter().flatten().any(is)
    };
    let light = theta_i || phi_i || of(Side::Light);
    let viewer = theta_o || phi_o || of(Side::Viewer);
    let scatter = match (light, viewer) {
        (true, false) => Some(Side::Viewer),
        (false, true) => Some(Side::Light),
        _ => None,
    };
    let mut places: [Option<usize>; 4] = [None; 4];
    let mut difference = None;
    for (column, found) in named.iter().enumerate() {
        let Some((direction, _)) = found else {
            continue;
        };
        let (first, side) = match direction {
            Direction::Theta(side) => (0, *side),
            Direction::Phi(side) => (1, *side),
            Direction::Difference => {
                difference = difference.or(Some(column));
                continue;
            }
            Direction::Component(_) => continue,
        };
        let side = match side {
            Side::ScatterOrSun => scatter.ok_or_else(|| Problem::WhichSide {
                column: shorten(&names[column]),
            })?,
            side => side,
        };
        let place = first + if side == Side::Light { 0 } else { 2 };
        if let Some(other) = places[place].replace(column) {
            return Err(Problem::SameAngle {
                angle: ANGLES[place],
                first: shorten(&names[other]),
                second: shorten(&names[column]),
            });
        }
    }
    Ok((places, difference))
}

/// A note of the columns that were taken for an angle under another name.
fn other_names(names: &[String], places: &[Option<usize>; 4]) -> Option<Note> {
    let mut others: Vec<String> = Vec::new();
    for (column, canonical) in places.iter().zip(ANGLES) {
        let Some(column) = *column else { continue };
        if !names[column].trim().eq_ignore_ascii_case(canonical) {
            others.push(format!("{} as {canonical}", shorten(&names[column])));
        }
    }
    let columns = List::of(&others);
    (!others.is_empty()).then_some(Note::Names { columns })
}

/// The unit that the names of the angles say, which must be the same.
fn one_unit(angles: &[Angle; 4], named: &[Option<Named>]) -> Result<Option<AngleUnit>, Problem> {
    let said = angles.iter().filter_map(|angle| match angle {
        Angle::Column(column) => named[*column].and_then(|(_, unit)| unit),
        Angle::Constant(_) => None,
    });
    let units: Vec<AngleUnit> = said.collect();
    let unit = units.first().copied();
    if units.iter().any(|&other| Some(other) != unit) {
        return Err(Problem::Units {
            said: "degrees and radians",
            advice: "all angles must be in one unit",
        });
    }
    Ok(unit)
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
/// name that says otherwise is an error, as that of an angle that no direction needs; so is one that says
/// nothing beside one that does say reflectance. Where no name says anything, there is nothing to tell
/// them by.
fn undisputed(names: &[String], rest: &[usize]) -> Result<Vec<usize>, Problem> {
    let is_angle = |column: usize| names::of(&names[column]).is_some();
    let kind = |&column: &usize| match is_angle(column) {
        true => Kind::NoValue,
        false => channel::kind(&names[column]),
    };
    let kinds: Vec<Kind> = rest.iter().map(kind).collect();
    if let &[only] = rest
        && !channel::is_one_word_for_something_else(&names[only])
        && !is_angle(only)
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
