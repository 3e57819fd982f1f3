//! From a pair of directions to the inputs of a network.

use std::fmt;
use std::str::FromStr;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::geometry::{NORMAL, Pair, Vector, dot, reflect};

/// A set of network inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Features {
    /// The paper's six, in its order: $L \cdot N$, $V \cdot R$, $\cos\theta_i$, $\sin\theta_i$,
    /// $\cos\theta_e$, $\sin\theta_e$ (section II).
    ///
    /// The third equals the first. All six are kept, as the paper has them: the repetition doubles
    /// the spread of the random weight on $\cos\theta_i$, so leaving it out would be another model.
    #[default]
    Paper,
}

impl Features {
    /// Every set there is.
    pub const ALL: [Self; 1] = [Self::Paper];

    /// The set's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
        }
    }

    /// The name of each input.
    #[must_use]
    pub fn inputs(self) -> &'static [&'static str] {
        match self {
            Self::Paper => &[
                "L.N",
                "V.R",
                "cos theta_i",
                "sin theta_i",
                "cos theta_e",
                "sin theta_e",
            ],
        }
    }

    /// The inputs of each pair of directions, shape (pairs, inputs).
    #[must_use]
    pub fn compute(self, pairs: &[Pair]) -> Array2<f64> {
        let mut out = Array2::zeros((pairs.len(), self.inputs().len()));
        for (mut row, pair) in out.rows_mut().into_iter().zip(pairs) {
            let values = match self {
                Self::Paper => paper(pair),
            };
            row.iter_mut()
                .zip(values)
                .for_each(|(input, value)| *input = value);
        }
        out
    }
}

fn paper(pair: &Pair) -> [f64; 6] {
    let (l, v) = (pair.incident, pair.outgoing);
    let sine = |w: Vector| w[0].hypot(w[1]);
    [
        dot(l, NORMAL),
        dot(v, reflect(l, NORMAL)),
        l[2],
        sine(l),
        v[2],
        sine(v),
    ]
}

impl fmt::Display for Features {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Features {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|set| set.name() == name)
            .ok_or_else(|| Error::UnknownName {
                what: "feature set",
                name: name.to_owned(),
                expected: Self::ALL.map(Self::name).join(", "),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cartesian;
    use std::f64::consts::{FRAC_PI_3, FRAC_PI_6, PI};

    #[test]
    fn the_papers_inputs_at_hand_computed_directions() {
        // Light at 30 degrees, viewer at 60 on the other side: R lies at 30 on the viewer's side,
        // 30 degrees from V.
        let pair = Pair {
            incident: cartesian(FRAC_PI_6, 0.0),
            outgoing: cartesian(FRAC_PI_3, PI),
        };
        let half_root_3 = 3.0_f64.sqrt() / 2.0;
        let expected = [half_root_3, half_root_3, half_root_3, 0.5, 0.5, half_root_3];
        let x = Features::Paper.compute(&[pair]);
        approx::assert_abs_diff_eq!(x, ndarray::arr2(&[expected]), epsilon = 1e-15);
    }

    #[test]
    fn names_are_read_back() {
        for set in Features::ALL {
            assert_eq!(set.name().parse::<Features>().unwrap(), set);
        }
        assert!("six".parse::<Features>().is_err());
    }
}
