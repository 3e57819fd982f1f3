//! What the name of a column says of a direction.

use crate::error::scattered::{AngleUnit, VECTORS};

/// Light or viewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Light,
    Viewer,
    /// `s`: the scattered light where another column is of the incident one, the sun where another is
    /// of the viewer.
    ScatterOrSun,
}

/// A column of directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    /// A polar angle.
    Theta(Side),
    /// An azimuth.
    Phi(Side),
    /// The viewer's azimuth less that of the light.
    Difference,
    /// A component of a vector, by its place in [`VECTORS`].
    Component(usize),
}

/// A direction, and the unit that the name says.
pub(super) type Named = (Direction, Option<AngleUnit>);

const THETA: &[&str] = &["theta", "th", "zenith", "polar", "za", "\u{3b8}"];
const PHI: &[&str] = &[
    "phi",
    "ph",
    "azimuth",
    "azimuthal",
    "az",
    "azi",
    "aa",
    "\u{3c6}",
    "\u{3d5}",
];
const LIGHT: &[&str] = &[
    "i",
    "in",
    "inc",
    "incident",
    "incoming",
    "incidence",
    "l",
    "light",
    "source",
    "src",
    "sun",
    "solar",
    "illumination",
    "illum",
    "lamp",
];
const VIEWER: &[&str] = &[
    "o",
    "out",
    "outgoing",
    "r",
    "refl",
    "reflected",
    "reflection",
    "v",
    "view",
    "viewer",
    "viewing",
    "e",
    "exit",
    "emission",
    "obs",
    "observer",
    "observation",
    "det",
    "detector",
    "sensor",
    "receiver",
    "camera",
];
const SCATTER: &[&str] = &["s"];
const CLEARLY_SCATTER: &[&str] = &["scatter", "scattered", "scattering"];
const DIFFERENCE: &[&str] = &[
    "d",
    "delta",
    "diff",
    "difference",
    "rel",
    "relative",
    "\u{3b4}",
];
const FILLER: &[&str] = &["angle", "direction", "of", "the", "ang"];
const DEGREES: &[&str] = &["deg", "degree", "degrees", "\u{b0}"];
const RADIANS: &[&str] = &["rad", "radian", "radians"];
/// Whole names that are not made of the words above.
const WHOLE: [(&str, Direction); 7] = [
    ("sza", Direction::Theta(Side::Light)),
    ("saa", Direction::Phi(Side::Light)),
    ("iza", Direction::Theta(Side::Light)),
    ("vza", Direction::Theta(Side::Viewer)),
    ("vaa", Direction::Phi(Side::Viewer)),
    ("raa", Direction::Difference),
    ("dphi", Direction::Difference),
];

/// What a name says, if it is that of a direction: `theta_i`, `Theta_in (deg)`, `phi_s`, `thi`,
/// `incident zenith`, `dphi`, `wi_x`.
pub(super) fn of(name: &str) -> Option<Named> {
    let name = name.trim().trim_matches('"').trim().to_lowercase();
    if let Some(place) = VECTORS.iter().position(|vector| *vector == name) {
        return Some((Direction::Component(place), None));
    }
    let words: Vec<&str> = name
        .split(|c: char| !c.is_alphanumeric() && c != '\u{b0}')
        .filter(|word| !word.is_empty())
        .collect();
    let mut unit = None;
    let mut rest: Vec<&str> = Vec::new();
    for word in words {
        if DEGREES.contains(&word) {
            unit = Some(AngleUnit::Degrees);
        } else if RADIANS.contains(&word) {
            unit = Some(AngleUnit::Radians);
        } else if !FILLER.contains(&word) {
            rest.push(word);
        }
    }
    let direction = match rest.as_slice() {
        [word] => whole(word)?,
        [a, b] => two(a, b).or_else(|| two(b, a))?,
        _ => return None,
    };
    Some((direction, unit))
}

/// A name of one word: an abbreviation, an azimuth alone, or an angle and a side without anything between.
fn whole(word: &str) -> Option<Direction> {
    if let Some(&(_, direction)) = WHOLE.iter().find(|(name, _)| *name == word) {
        return Some(direction);
    }
    // An azimuth of no side is between the two.
    if PHI.contains(&word) {
        return Some(Direction::Difference);
    }
    let split = |angles: &[&str]| {
        let rests = angles.iter().filter_map(|angle| word.strip_prefix(angle));
        rests.filter_map(side).next()
    };
    split(THETA)
        .map(Direction::Theta)
        .or_else(|| split(PHI).map(Direction::Phi))
}

fn two(angle: &str, other: &str) -> Option<Direction> {
    if THETA.contains(&angle) {
        side(other).map(Direction::Theta)
    } else if PHI.contains(&angle) {
        let difference = DIFFERENCE.contains(&other).then_some(Direction::Difference);
        side(other).map(Direction::Phi).or(difference)
    } else {
        None
    }
}

fn side(word: &str) -> Option<Side> {
    let is = |list: &[&str]| list.contains(&word);
    if is(LIGHT) {
        Some(Side::Light)
    } else if is(VIEWER) || is(CLEARLY_SCATTER) {
        Some(Side::Viewer)
    } else if is(SCATTER) {
        Some(Side::ScatterOrSun)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_directions_are_known_in_their_spellings() {
        use Direction::{Component, Difference, Phi, Theta};
        use Side::{Light, ScatterOrSun, Viewer};
        for (name, direction) in [
            ("theta_i", Theta(Light)),
            ("Theta_in (deg)", Theta(Light)),
            ("thi", Theta(Light)),
            ("thetaI", Theta(Light)),
            ("incident zenith", Theta(Light)),
            ("solar_zenith_angle", Theta(Light)),
            ("SZA", Theta(Light)),
            ("Theta_s", Theta(ScatterOrSun)),
            ("theta_r", Theta(Viewer)),
            ("theta_v [deg]", Theta(Viewer)),
            ("phi_o", Phi(Viewer)),
            ("azimuth_in", Phi(Light)),
            ("view azimuth", Phi(Viewer)),
            ("phi", Difference),
            ("delta_phi", Difference),
            ("relative azimuth", Difference),
            ("\"wo_z\"", Component(5)),
        ] {
            assert_eq!(of(name).map(|(found, _)| found), Some(direction), "{name}");
        }
        for name in [
            "theta", "brdf", "r", "phi_q", "theta_h", "red", "i", "", "\u{3b8}",
        ] {
            assert!(of(name).is_none(), "{name}");
        }
        assert_eq!(of("theta_i_deg").unwrap().1, Some(AngleUnit::Degrees));
        assert_eq!(of("theta_i [rad]").unwrap().1, Some(AngleUnit::Radians));
    }
}
