//! CUReT's 61 materials by number and by name.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::text::shorten;

/// How many materials there are.
pub const MATERIALS: usize = 61;

/// The names, as the database gives them; material `k` is at index `k - 1`.
#[rustfmt::skip]
pub const NAMES: [&str; MATERIALS] = [
    "Felt", "Polyester", "Terrycloth", "Rough Plastic", "Leather", "Sandpaper", "Velvet",
    "Pebbles", "Frosted Glass", "Plaster A", "Plaster B", "Rough Paper", "Artificial Grass",
    "Roof Shingle", "Aluminum Foil", "Cork", "Rough Tile", "Rug A", "Rug B", "Styrofoam",
    "Sponge", "Lambswool", "Lettuce Leaf", "Rabbit Fur", "Quarry Tile", "Loofa", "Insulation",
    "Crumpled Paper", "Polyester (zoomed)", "Plaster B (zoomed)", "Rough Paper (zoomed)",
    "Roof Shingle (zoomed)", "Slate A", "Slate B", "Painted Spheres", "Limestone", "Brick A",
    "Ribbed Paper", "Human Skin", "Straw", "Brick B", "Corduroy", "Salt Crystals", "Linen",
    "Concrete A", "Cotton", "Stones", "Brown Bread", "Concrete B", "Concrete C", "Corn Husk",
    "White Bread", "Soleirolia Plant", "Wood A", "Orange Peel", "Wood B", "Peacock Feather",
    "Tree Bark", "Cracker A", "Cracker B", "Moss",
];

/// Other names in use, already in [`plain`] form: the short one in print, the British spelling.
const ALIASES: [(&str, usize); 2] = [("foil", 15), ("aluminiumfoil", 15)];

/// Number of a material, 1 to 61.
///
/// Its text form, for [`Display`](fmt::Display) and in serialised data, is that number.
/// [`FromStr`] takes the number or one of CUReT's names.
///
/// ```
/// use elm_datasets::MaterialId;
///
/// let felt: MaterialId = "felt".parse()?;
/// assert_eq!((felt.number(), felt), (1, MaterialId::new(1)?));
/// assert!("felp".parse::<MaterialId>().is_err_and(|error| error.to_string().contains("Felt")));
/// assert_eq!(MaterialId::all().count(), 61);
/// # Ok::<(), elm_datasets::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "usize", into = "usize")]
pub struct MaterialId(u8);

impl MaterialId {
    /// The material with this number.
    ///
    /// # Errors
    /// [`Error::MaterialNumber`] unless the number is 1 to 61.
    pub fn new(number: usize) -> Result<Self, Error> {
        match u8::try_from(number) {
            Ok(small) if (1..=MATERIALS).contains(&number) => Ok(Self(small)),
            _ => Err(Error::MaterialNumber {
                number,
                last: MATERIALS,
            }),
        }
    }

    /// All of them in order.
    pub fn all() -> impl ExactSizeIterator<Item = Self> + Clone {
        (0..MATERIALS as u8).map(|index| Self(index + 1))
    }

    /// The number, 1 to 61.
    #[must_use]
    pub fn number(self) -> usize {
        usize::from(self.0)
    }

    /// The number less one: the place in [`NAMES`].
    #[must_use]
    pub fn index(self) -> usize {
        usize::from(self.0) - 1
    }

    /// The material that this one is a second measurement of, nearer to the camera; itself where it
    /// is none. Where materials are pooled, both must stand on one side of every division.
    ///
    /// ```
    /// use elm_datasets::MaterialId;
    /// assert_eq!(MaterialId::new(29)?.specimen(), MaterialId::new(2)?);
    /// assert_eq!(MaterialId::new(39)?.specimen(), MaterialId::new(39)?);
    /// # Ok::<(), elm_datasets::Error>(())
    /// ```
    #[must_use]
    pub fn specimen(self) -> Self {
        Self(match self.0 {
            29 => 2,
            30 => 11,
            31 => 12,
            32 => 14,
            own => own,
        })
    }

    /// CUReT's name for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        NAMES[self.index()]
    }

    /// Finds a material by its number, or by its name among `names`.
    ///
    /// Only letters and digits count, and case does not: "human-skin" finds "Human Skin".
    pub(crate) fn find<S: AsRef<str>>(
        text: &str,
        names: &'static [S],
        aliases: &[(&str, usize)],
    ) -> Result<Self, Error> {
        if let Ok(number) = text.trim().parse::<usize>() {
            return Self::new(number);
        }
        let wanted = plain(text);
        let alias = aliases
            .iter()
            .find(|(alias, _)| *alias == wanted)
            .map(|&(_, number)| number);
        let exact = Self::all()
            .zip(names)
            .find(|(_, name)| plain(name.as_ref()) == wanted);
        if let Some(id) = exact
            .map(|(id, _)| id)
            .or_else(|| alias.and_then(|number| Self::new(number).ok()))
        {
            return Ok(id);
        }
        let name = shorten(text);
        let candidates: Vec<_> = names
            .iter()
            .map(AsRef::as_ref)
            .filter(|candidate| !wanted.is_empty() && plain(candidate).starts_with(&wanted))
            .collect();
        if candidates.len() > 1 {
            return Err(Error::AmbiguousMaterial { name, candidates });
        }
        Err(Error::UnknownMaterial {
            name,
            closest: closest(&wanted, names),
        })
    }
}

impl FromStr for MaterialId {
    type Err = Error;

    /// Finds a material by its number or by its CUReT name, of which only letters and digits
    /// count, in either case: "39", "human-skin" and "Human Skin" are the same. "Foil" is
    /// material 15.
    ///
    /// # Errors
    /// - [`Error::MaterialNumber`]: a number, but not 1 to 61.
    /// - [`Error::AmbiguousMaterial`]: the beginning of several names, as "Plaster" is.
    /// - [`Error::UnknownMaterial`]: no such name; the error carries the closest ones.
    fn from_str(text: &str) -> Result<Self, Error> {
        Self::find(text, &NAMES, &ALIASES)
    }
}

impl fmt::Display for MaterialId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl TryFrom<usize> for MaterialId {
    type Error = Error;

    fn try_from(number: usize) -> Result<Self, Error> {
        Self::new(number)
    }
}

impl From<MaterialId> for usize {
    fn from(id: MaterialId) -> Self {
        id.number()
    }
}

/// Letters and digits only, in lower case.
fn plain(name: &str) -> String {
    name.chars()
        .filter(|c| c.is_alphanumeric())
        .flat_map(char::to_lowercase)
        .collect()
}

/// The three names with the smallest edit distance, relative to length.
fn closest<S: AsRef<str>>(wanted: &str, names: &'static [S]) -> Vec<&'static str> {
    // The distance costs the product of both lengths, and no name is longer than this.
    let wanted: String = wanted.chars().take(32).collect();
    let mut ranked: Vec<(f64, &str)> = names
        .iter()
        .map(AsRef::as_ref)
        .map(|name| {
            (
                strsim::normalized_damerau_levenshtein(&wanted, &plain(name)),
                name,
            )
        })
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.into_iter().take(3).map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> usize {
        text.parse::<MaterialId>().unwrap().number()
    }

    #[test]
    fn every_name_and_every_number_finds_its_material() {
        for (index, name) in NAMES.iter().enumerate() {
            assert_eq!(number(name), index + 1);
            assert_eq!(number(&(index + 1).to_string()), index + 1);
            assert_eq!(MaterialId::new(index + 1).unwrap().name(), *name);
        }
    }

    #[test]
    fn case_punctuation_and_blanks_do_not_count() {
        for (text, expected) in [
            ("human-skin", 39),
            ("Human Skin", 39),
            (" 39 ", 39),
            ("HUMANSKIN", 39),
            ("polyester (zoomed)", 29),
            ("polyester-zoomed", 29),
            ("Polyester", 2),
            ("brick_b", 41),
            ("Foil", 15),
            ("aluminium foil", 15),
        ] {
            assert_eq!(number(text), expected, "{text}");
        }
    }

    #[test]
    fn the_beginning_of_several_names_is_refused_with_all_of_them() {
        let error = "plaster".parse::<MaterialId>().unwrap_err();
        let Error::AmbiguousMaterial { candidates, .. } = error else {
            panic!("{error}")
        };
        assert_eq!(candidates, ["Plaster A", "Plaster B", "Plaster B (zoomed)"]);
    }

    #[test]
    fn a_misspelt_name_is_answered_with_the_one_meant() {
        for (text, meant) in [
            ("courdroy", "Corduroy"),
            ("humanskn", "Human Skin"),
            ("mos", "Moss"),
        ] {
            let error = text.parse::<MaterialId>().unwrap_err();
            let Error::UnknownMaterial { name, closest } = error else {
                panic!("{error}")
            };
            assert_eq!((name.as_str(), closest[0]), (text, meant));
        }
    }

    #[test]
    fn texts_that_name_nothing_are_errors() {
        for text in [
            "",
            " ",
            "-1",
            "3.0",
            "()",
            "99999999999999999999999",
            &"x".repeat(100_000),
        ] {
            let error = text.parse::<MaterialId>().unwrap_err();
            assert!(matches!(error, Error::UnknownMaterial { .. }), "{error}");
        }
        for text in ["0", "62", "256", "257"] {
            let error = text.parse::<MaterialId>().unwrap_err();
            assert!(matches!(error, Error::MaterialNumber { .. }), "{error}");
        }
    }
}
