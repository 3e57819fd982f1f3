//! Interprets the name of a channel: a colour, a wavelength, or neither.
//!
//! Channels of different files are matched by this, never by position.

mod words;

use std::ops::Range;

use words::{NO_VALUES, VALUES};

/// What a channel is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Meaning {
    /// Red, green or blue: 0, 1 or 2.
    Primary(usize),
    /// A wavelength in nm.
    Wavelength(f64),
    /// Anything else, in lower case.
    Other(String),
}

/// What the name of a column of a table says about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Reflectance.
    Value,
    /// Certainly none.
    NoValue,
    /// The wavelength of the row.
    Wavelength,
    /// Nothing that is known here.
    Unknown,
}

impl Meaning {
    /// What a name says: `r`, `Red`, `brdf_g`, `550`, `550nm`, `0.55 um`, `brdf 550 nm`.
    ///
    /// ```
    /// use elm_datasets::channel::Meaning;
    /// assert_eq!(Meaning::of("Red"), Meaning::Primary(0));
    /// assert_eq!(Meaning::of("0.55 um"), Meaning::of("550nm"));
    /// assert_eq!(Meaning::of("Felt"), Meaning::Other("felt".to_owned()));
    /// ```
    #[must_use]
    pub fn of(name: &str) -> Self {
        let words = words(name);
        // 'R450' is a reflectance at 450 nm, not a red.
        if let Some(nm) = wavelength(&words) {
            return Self::Wavelength(nm);
        }
        let primary = |word: &String| match word.as_str() {
            "r" | "red" => Some(0),
            "g" | "green" => Some(1),
            "b" | "blue" => Some(2),
            _ => None,
        };
        let mut primaries = words.iter().filter_map(primary);
        match (primaries.next(), primaries.next()) {
            (Some(index), None) => Self::Primary(index),
            _ => Self::Other(name.trim().to_lowercase()),
        }
    }

    /// Whether two names mean the same channel.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            // Printed with fewer digits in one of two files.
            (Self::Wavelength(a), Self::Wavelength(b)) => (a - b).abs() <= 1e-6 * a.abs(),
            _ => self == other,
        }
    }
}

/// For each channel of `wanted` its place among `found`, by name, colour or wavelength; a single
/// channel matches a single one unless both names say that they are different ones. Names that no
/// one has written down (no names at all) are matched by position.
///
/// `None` if a channel of `wanted` is not among `found`, or is there twice.
///
/// ```
/// let names = |list: [&str; 3]| list.map(str::to_owned);
/// let (rgb, bgr) = (names(["red", "green", "blue"]), names(["b", "g", "r"]));
/// assert_eq!(elm_datasets::channel::places(&rgb, &bgr), Some(vec![2, 1, 0]));
/// ```
#[must_use]
pub fn places(wanted: &[String], found: &[String]) -> Option<Vec<usize>> {
    let means = |names: &[String]| names.iter().map(|n| Meaning::of(n)).collect::<Vec<_>>();
    let (wanted_means, found_means) = (means(wanted), means(found));
    let by_name: Option<Vec<usize>> = (0..wanted.len())
        .map(|index| {
            let by = |same: &dyn Fn(usize) -> bool| {
                let mut all = (0..found.len()).filter(|&place| same(place));
                all.next().filter(|_| all.next().is_none())
            };
            by(&|place| found[place] == wanted[index])
                .or_else(|| by(&|place| found_means[place].is_same(&wanted_means[index])))
        })
        .collect();
    if let Some(places) = by_name {
        let mut seen = places.clone();
        seen.sort_unstable();
        seen.dedup();
        return (seen.len() == places.len()).then_some(places);
    }
    // One of the two says wavelengths and the other colours.
    if let (Some(a), Some(b), 3, 3) = (rgb(wanted), rgb(found), wanted.len(), found.len()) {
        let mut places = vec![0; 3];
        for (&to, &from) in a.iter().zip(&b) {
            places[to] = from;
        }
        return Some(places);
    }
    match (wanted_means.as_slice(), found_means.as_slice()) {
        ([a], [b]) if is_unspecific(a) || is_unspecific(b) => Some(vec![0]),
        _ => None,
    }
}

fn is_unspecific(meaning: &Meaning) -> bool {
    matches!(meaning, Meaning::Other(_))
}

/// The place of the one channel that a name means, by the name or what it says.
pub(crate) fn place(name: &str, among: &[String]) -> Option<usize> {
    let exact = |other: &String| other.trim().eq_ignore_ascii_case(name.trim());
    if let Some(place) = among.iter().position(exact) {
        return Some(place);
    }
    let meaning = Meaning::of(name);
    let is = |other: &String| Meaning::of(other).is_same(&meaning);
    let mut same = (0..among.len()).filter(|&place| is(&among[place]));
    same.next().filter(|_| same.next().is_none())
}

/// The places of red, green and blue among three channels: by their colours, or by their
/// wavelengths, the longest for red. `None` where the names do not say.
#[must_use]
pub fn rgb(channels: &[String]) -> Option<[usize; 3]> {
    if channels.len() != 3 {
        return None;
    }
    let means: Vec<Meaning> = channels.iter().map(|name| Meaning::of(name)).collect();
    let primary = |index| means.iter().position(|m| *m == Meaning::Primary(index));
    if let (Some(r), Some(g), Some(b)) = (primary(0), primary(1), primary(2)) {
        return Some([r, g, b]);
    }
    let length = |index: usize| match means[index] {
        Meaning::Wavelength(nm) => Some(nm),
        _ => None,
    };
    let lengths = [length(0)?, length(1)?, length(2)?];
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]));
    (lengths[order[0]] > lengths[order[1]] && lengths[order[1]] > lengths[order[2]])
        .then_some(order)
}

/// Fewer wavelengths are no spectrum: three are taken for [red, green and blue](rgb).
pub const SPECTRUM: usize = 4;

/// The wavelengths in nm of channels that are a spectrum: at least [`SPECTRUM`] of them, each a wavelength
/// and all different, with names that say nothing else or all the same beside it. `None` otherwise.
///
/// ```
/// let names = ["400 nm", "500 nm", "600 nm", "700 nm"].map(str::to_owned);
/// let found = elm_datasets::channel::spectrum(&names);
/// assert_eq!(found, Some(vec![400.0, 500.0, 600.0, 700.0]));
/// ```
#[must_use]
pub fn spectrum(channels: &[String]) -> Option<Vec<f64>> {
    let mut first: Option<Vec<String>> = None;
    let mut lengths = Vec::with_capacity(channels.len());
    for name in channels {
        let (nm, rest) = wavelength_and_rest(name)?;
        if first.get_or_insert_with(|| rest.clone()) != &rest {
            return None;
        }
        lengths.push(nm);
    }
    let mut sorted = lengths.clone();
    sorted.sort_by(f64::total_cmp);
    let different = sorted.windows(2).all(|two| two[0] < two[1]);
    (channels.len() >= SPECTRUM && different).then_some(lengths)
}

/// Names for a line of text: those of a spectrum in short, and of others no more than eight.
///
/// ```
/// let names: Vec<String> = (0..16).map(|k| format!("{} nm", 400 + 20 * k)).collect();
/// assert_eq!(elm_datasets::channel::described(&names), "16 wavelengths from 400 to 700 nm");
/// ```
#[must_use]
pub fn described(channels: &[String]) -> String {
    const MOST: usize = 8;
    if let Some(lengths) = spectrum(channels) {
        let first = lengths.iter().copied().fold(f64::INFINITY, f64::min);
        let last = lengths.iter().copied().fold(0.0, f64::max);
        return format!("{} wavelengths from {first} to {last} nm", lengths.len());
    }
    match channels.get(..MOST) {
        Some(some) if channels.len() > MOST => {
            format!("{}, ... ({} in all)", some.join(", "), channels.len())
        }
        _ => channels.join(", "),
    }
}

/// Two names of the same wavelength that say the same of it, if there are such.
pub(crate) fn same_wavelength(names: &[&String]) -> Option<(usize, usize)> {
    let mut known: Vec<(f64, Vec<String>, usize)> = names
        .iter()
        .enumerate()
        .filter_map(|(place, name)| wavelength_and_rest(name).map(|(nm, rest)| (nm, rest, place)))
        .collect();
    known.sort_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)).then(a.2.cmp(&b.2)));
    let same = known
        .windows(2)
        .find(|two| two[0].1 == two[1].1 && two[0].0 == two[1].0)?;
    Some((same[0].2, same[1].2))
}

/// The wavelength that a name says, and what else it says.
fn wavelength_and_rest(name: &str) -> Option<(f64, Vec<String>)> {
    let words = words(name);
    let nm = wavelength(&words)?;
    let other = |word: &String| word.parse::<f64>().is_err() && !UNITS.contains(&word.as_str());
    Some((nm, words.into_iter().filter(other).collect()))
}

/// What the name of a column says.
pub(crate) fn kind(name: &str) -> Kind {
    let words = words(name);
    let is = |list: &[&str], word: &String| list.contains(&word.as_str());
    let lengths = ["wavelength", "wavelengths", "wave", "lambda", "wl"];
    if !words.is_empty()
        && words
            .iter()
            .all(|w| is(&lengths, w) || is(&UNITS, w) || w == "in")
    {
        return Kind::Wavelength;
    }
    if wavelength(&words).is_some() && !words.iter().any(|w| is_no_value(w)) {
        return Kind::Value;
    }
    if words.iter().any(|w| is_no_value(w)) {
        Kind::NoValue
    } else if words.iter().any(|w| is(VALUES, w)) {
        Kind::Value
    } else {
        Kind::Unknown
    }
}

/// Words that each say that values are reflectance factors.
const FACTORS: [&str; 3] = ["brf", "hdrf", "hcrf"];

/// Whether a name says that values are reflectance factors: the BRDF times pi.
pub(crate) fn is_reflectance_factor(name: &str) -> bool {
    let words = words(name);
    let has = |word: &str| words.iter().any(|other| other == word);
    FACTORS.into_iter().any(has) || has("reflectance") && has("factor")
}

/// The name of what a column of reflectance factors holds once it is divided by pi: `brdf 550 nm` of
/// `BRF 550 nm`. It no longer says that they are factors: read again, they must not be divided again.
pub(crate) fn without_factor(name: &str) -> String {
    let lower = name.trim().to_lowercase();
    let (mut renamed, mut end) = (String::new(), 0);
    for range in word_ranges(&lower) {
        let (between, word) = (&lower[end..range.start], &lower[range.clone()]);
        end = range.end;
        if word == "factor" {
            // With what separates it from the word before, unless that would join two words.
            if !lower[end..].is_empty() && !lower[end..].starts_with(is_separator) {
                renamed.push(' ');
            }
            continue;
        }
        renamed.push_str(between);
        let is_factor = word == "reflectance" || FACTORS.contains(&word);
        renamed.push_str(if is_factor { "brdf" } else { word });
    }
    renamed.push_str(&lower[end..]);
    renamed.trim().to_owned()
}

fn is_separator(c: char) -> bool {
    !c.is_alphanumeric()
}

/// Whether a name is a single word, and one that says something else than reflectance.
pub(crate) fn is_one_word_for_something_else(name: &str) -> bool {
    match words(name).as_slice() {
        [word] => NO_VALUES.contains(&word.as_str()),
        _ => false,
    }
}

/// Words that stand beside a wavelength without making it something else.
fn is_no_value(word: &str) -> bool {
    NO_VALUES.contains(&word) && !["lambda", "wl", "wavelength"].contains(&word)
}

const UNITS: [&str; 6] = ["nm", "um", "\u{b5}m", "\u{3bc}m", "micron", "microns"];

/// Factor to nm that a name's unit asks for; `None` where it names no unit.
pub(crate) fn unit(name: &str) -> Option<f64> {
    let words = words(name);
    let unit = words.iter().find(|word| UNITS.contains(&word.as_str()))?;
    Some(if unit == "nm" { 1.0 } else { 1000.0 })
}

/// The wavelength in nm that a name's only number is: with a unit, or of a size that says it.
fn wavelength(words: &[String]) -> Option<f64> {
    let mut numbers = words.iter().filter_map(|word| word.parse::<f64>().ok());
    let number = numbers.next().filter(|_| numbers.next().is_none())?;
    let unit = words.iter().find(|word| UNITS.contains(&word.as_str()));
    let nm = match unit.map(String::as_str) {
        Some("nm") => number,
        Some(_) => 1000.0 * number,
        None => in_nm(number)?,
    };
    (nm > 0.0 && nm.is_finite()).then_some(nm)
}

/// A number of optical wavelengths that says itself whether it is in nm or in um.
fn in_nm(number: f64) -> Option<f64> {
    if (100.0..=25_000.0).contains(&number) {
        Some(number)
    } else if (0.1..=25.0).contains(&number) && number.fract() != 0.0 {
        Some(1000.0 * number)
    } else {
        None
    }
}

/// The words of a name: runs of letters and numbers, in lower case.
fn words(name: &str) -> Vec<String> {
    let name = name.to_lowercase();
    let ranges = word_ranges(&name).into_iter();
    ranges.map(|range| name[range].to_owned()).collect()
}

/// Where the words of a name in lower case are.
fn word_ranges(name: &str) -> Vec<Range<usize>> {
    let mut words: Vec<Range<usize>> = Vec::new();
    let mut last = ' ';
    let mut rest = name.char_indices().peekable();
    while let Some((at, c)) = rest.next() {
        let next = rest.peek().map(|&(_, next)| next);
        let point =
            c == '.' && last.is_ascii_digit() && next.is_some_and(|next| next.is_ascii_digit());
        let continues = match (last, c) {
            (_, '.') => point,
            (l, c) if c.is_ascii_digit() => l.is_ascii_digit() || l == '.',
            (l, c) => c.is_alphabetic() && l.is_alphabetic(),
        };
        let end = at + c.len_utf8();
        match words.last_mut() {
            Some(word) if continues => word.end = end,
            _ if c.is_alphanumeric() => words.push(at..end),
            _ => {}
        }
        last = if c == '.' && !point { ' ' } else { c };
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn names_say_colors_and_wavelengths() {
        for (name, nm) in [
            ("550", 550.0),
            ("550nm", 550.0),
            ("550.5 nm", 550.5),
            ("BRDF(632.8nm)", 632.8),
            ("0.6328um", 632.8),
            ("lambda_1550", 1550.0),
            ("10.6 \u{b5}m", 10_600.0),
            ("R450", 450.0),
        ] {
            let found = Meaning::of(name);
            assert!(found.is_same(&Meaning::Wavelength(nm)), "{name}: {found:?}");
        }
        assert_eq!(Meaning::of("brdf_G"), Meaning::Primary(1));
        assert_eq!(Meaning::of("c1"), Meaning::Other("c1".to_owned()));
    }

    #[test]
    fn a_spectrum_is_of_wavelengths_that_differ() {
        let of = |list: &[&str]| spectrum(&names(list));
        let expected = Some(vec![400.0, 500.0, 600.0, 700.0]);
        assert_eq!(of(&["400 nm", "500nm", "600.0", "0.7 um"]), expected);
        assert_eq!(of(&["R400", "R500", "R600", "R700"]), expected);
        for none in [
            &["400", "500", "600"][..],
            &["400", "500", "600", "600 nm"],
            &["400", "500", "600", "felt"],
            &["s 400", "s 500", "p 400", "p 500"],
            &["s 400", "s 500", "p 600", "p 700"],
        ] {
            assert_eq!(of(none), None, "{none:?}");
        }
        let twice = names(&["400", "s 400", "500", "400.0 nm"]);
        assert_eq!(
            same_wavelength(&twice.iter().collect::<Vec<_>>()),
            Some((0, 3))
        );
    }

    #[test]
    fn names_of_factors_become_those_of_values() {
        for (name, expected) in [
            ("BRF 550 nm", "brdf 550 nm"),
            ("hdrf550", "brdf550"),
            ("Reflectance_factor", "brdf"),
            (
                "bidirectional reflectance factor (550nm)",
                "bidirectional brdf (550nm)",
            ),
            ("factor of reflectance 550", "of brdf 550"),
            ("reflectance 550 nm factor", "brdf 550 nm"),
            ("reflectance550factor650", "brdf550 650"),
            // Of two words that say it both, and of neither a part.
            ("BRF 550hcrfm", "brdf 550hcrfm"),
            ("hcrf/brf", "brdf/brdf"),
        ] {
            let renamed = without_factor(name);
            assert_eq!(renamed, expected);
            assert!(is_reflectance_factor(name), "{name}");
            assert!(!is_reflectance_factor(&renamed), "{name}");
        }
    }

    #[test]
    fn columns_are_told_apart_by_their_words() {
        for (name, expected) in [
            ("brdf", Kind::Value),
            ("BRDF [1/sr]", Kind::Value),
            ("r", Kind::Value),
            ("550 nm", Kind::Value),
            ("brdf_std", Kind::NoValue),
            ("std_550", Kind::NoValue),
            ("u(brdf)", Kind::NoValue),
            ("row", Kind::NoValue),
            ("Sample No.", Kind::NoValue),
            ("theta_h", Kind::NoValue),
            ("wavelength_nm", Kind::Wavelength),
            ("Wavelength (um)", Kind::Wavelength),
            ("lambda", Kind::Wavelength),
            ("nm", Kind::Wavelength),
            ("felt", Kind::Unknown),
        ] {
            assert_eq!(kind(name), expected, "{name}");
        }
    }

    #[test]
    fn channels_are_matched_by_what_they_are() {
        let of = |a: &[&str], b: &[&str]| places(&names(a), &names(b));
        assert_eq!(
            of(&["r", "g", "b"], &["Blue", "Green", "Red"]),
            Some(vec![2, 1, 0])
        );
        assert_eq!(
            of(&["450 nm", "650 nm"], &["650", "550", "450"]),
            Some(vec![2, 0])
        );
        assert_eq!(
            of(&["r", "g", "b"], &["450", "550", "650"]),
            Some(vec![2, 1, 0])
        );
        assert_eq!(of(&["grey"], &["brdf"]), Some(vec![0]));
        assert_eq!(of(&["450"], &["650"]), None);
        assert_eq!(of(&["r", "g"], &["r", "b"]), None);
        assert_eq!(of(&["a", "b", "c"], &["d", "e", "f"]), None);
        assert_eq!(
            rgb(&names(&["450 nm", "550 nm", "650 nm"])),
            Some([2, 1, 0])
        );
        assert_eq!(rgb(&names(&["u", "v", "w"])), None);
    }
}
