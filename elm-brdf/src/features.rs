//! Computes the inputs of a network from pairs of directions.

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayViewMut1};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use elm_datasets::geometry::{DirectionPair, NORMAL, Vector, dot, reflect};

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
    /// $\theta_h$, $\theta_d$, $\cos\theta_i + \cos\theta_o$, $\cos\theta_i \cos\theta_o$ and
    /// $\sin\theta_i \sin\theta_o \cos(\varphi_i - \varphi_o)$. Reciprocal.
    HalfDiff,
    /// $\cos\theta_h$, $\cos\theta_d$, $\cos\theta_i$ and $\cos\theta_o$. Tells light from
    /// viewer, as measurements do that are not reciprocal.
    Cosines,
    /// $\cos\theta_h$, $\cos\theta_d$, $\cos\theta_i + \cos\theta_o$ and
    /// $\cos\theta_o - \cos\theta_i$. Tells light from viewer as [`Cosines`](Self::Cosines) does,
    /// but by an input of its own, so that a network can heed that less than the others.
    SumDifference,
    /// $\cos\theta_h$, $\cos\theta_d$, $\cos\theta_i + \cos\theta_o$ and
    /// $\cos\theta_i \cos\theta_o$. Reciprocal.
    ReciprocalCosines,
    /// $\sqrt{\theta_h}$, $\cos\theta_d$, $\cos\theta_i \cos\theta_o$ and
    /// $\cos\theta_i + \cos\theta_o$: the root spreads out the angles where a mirror-like
    /// highlight changes fast. Reciprocal.
    Highlight,
    /// $\sqrt{\sin\theta_h}$, $\cos^2\theta_d$ and $\cos\theta_i \cos\theta_o$: the same in three
    /// numbers, which is as many as a reciprocal isotropic material depends on, and from directions by
    /// arithmetic and two square roots. Reciprocal.
    Algebraic,
    /// $\sqrt{\theta_h}$, $\cos\theta_d$, $\cos\theta_i$ and $\cos\theta_o$: spreads out the
    /// highlight as [`Highlight`](Self::Highlight) does, and tells light from viewer.
    HighlightCosines,
    /// $\sqrt{\theta_h}$, $\cos\theta_d$, $\cos\theta_i \cos\theta_o$, $\cos\theta_i + \cos\theta_o$,
    /// $\sqrt{\theta_h} \cos 2(\varphi_h - \varphi)$ and $\sqrt{\theta_h} \sin 2(\varphi_h - \varphi)$: turns
    /// with the surface, for one with a grain along or across $\varphi$, and is the same after half a turn.
    /// Reciprocal.
    Anisotropic {
        /// The azimuth $\varphi$ in degrees.
        degrees: u8,
    },
}

impl Features {
    /// Every set there is.
    pub const ALL: [Self; 9] = [
        Self::Paper,
        Self::HalfDiff,
        Self::Cosines,
        Self::SumDifference,
        Self::ReciprocalCosines,
        Self::Highlight,
        Self::Algebraic,
        Self::HighlightCosines,
        Self::Anisotropic { degrees: 0 },
    ];

    /// The set's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::HalfDiff => "half-diff",
            Self::Cosines => "cosines",
            Self::SumDifference => "sum-difference",
            Self::ReciprocalCosines => "reciprocal-cosines",
            Self::Highlight => "highlight",
            Self::HighlightCosines => "highlight-cosines",
            Self::Algebraic => "algebraic",
            Self::Anisotropic { .. } => "anisotropic",
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
            Self::HalfDiff => &[
                "theta_h",
                "theta_d",
                "cos theta_i + cos theta_o",
                "cos theta_i cos theta_o",
                "sin theta_i sin theta_o cos dphi",
            ],
            Self::Cosines => &["cos theta_h", "cos theta_d", "cos theta_i", "cos theta_o"],
            Self::SumDifference => &[
                "cos theta_h",
                "cos theta_d",
                "cos theta_i + cos theta_o",
                "cos theta_o - cos theta_i",
            ],
            Self::ReciprocalCosines => &[
                "cos theta_h",
                "cos theta_d",
                "cos theta_i + cos theta_o",
                "cos theta_i cos theta_o",
            ],
            Self::Highlight => &[
                "sqrt theta_h",
                "cos theta_d",
                "cos theta_i cos theta_o",
                "cos theta_i + cos theta_o",
            ],
            Self::HighlightCosines => {
                &["sqrt theta_h", "cos theta_d", "cos theta_i", "cos theta_o"]
            }
            Self::Anisotropic { .. } => &[
                "sqrt theta_h",
                "cos theta_d",
                "cos theta_i cos theta_o",
                "cos theta_i + cos theta_o",
                "sqrt theta_h cos 2 phi_h",
                "sqrt theta_h sin 2 phi_h",
            ],
            Self::Algebraic => &[
                "sqrt sin theta_h",
                "cos^2 theta_d",
                "cos theta_i cos theta_o",
            ],
        }
    }

    /// Whether exchanging light and viewer changes no input, not even by a rounding: a model of
    /// these inputs is then reciprocal by construction.
    #[must_use]
    pub fn is_reciprocal(self) -> bool {
        !matches!(
            self,
            Self::Paper | Self::Cosines | Self::SumDifference | Self::HighlightCosines
        )
    }

    /// Whether turning the surface about its normal changes no input.
    #[must_use]
    pub fn is_isotropic(self) -> bool {
        !matches!(self, Self::Anisotropic { .. })
    }

    /// The azimuth in radians that inputs count from.
    #[must_use]
    pub fn azimuth(self) -> f64 {
        match self {
            Self::Anisotropic { degrees } => f64::from(degrees).to_radians(),
            _ => 0.0,
        }
    }

    /// The same set for a grain along x.
    pub(crate) fn along_x(self) -> Self {
        match self {
            Self::Anisotropic { .. } => Self::Anisotropic { degrees: 0 },
            other => other,
        }
    }

    /// The inputs of each pair of directions, shape (pairs, inputs).
    ///
    /// All sets but [`Anisotropic`](Self::Anisotropic) depend on the angles $\theta_i$, $\theta_o$ and
    /// $|\varphi_i - \varphi_o|$ alone, as an isotropic surface does. Finite for every pair of unit vectors,
    /// those below the horizon, grazing or coincident included.
    #[must_use]
    pub fn compute(self, pairs: &[DirectionPair]) -> Array2<f64> {
        let mut out = Array2::zeros((pairs.len(), self.inputs().len()));
        let fill = |mut row: ArrayViewMut1<'_, f64>, values: &[f64]| {
            row.iter_mut()
                .zip(values)
                .for_each(|(input, &value)| *input = value);
        };
        for (row, pair) in out.rows_mut().into_iter().zip(pairs) {
            match self {
                Self::Paper => fill(row, &paper(pair)),
                Self::HalfDiff => fill(row, &half_diff(pair)),
                Self::Cosines => fill(row, &cosines(pair)),
                Self::SumDifference => fill(row, &sum_difference(pair)),
                Self::ReciprocalCosines => fill(row, &reciprocal_cosines(pair)),
                Self::Highlight => fill(row, &highlight(pair)),
                Self::HighlightCosines => fill(row, &highlight_cosines(pair)),
                Self::Algebraic => fill(row, &algebraic(pair)),
                Self::Anisotropic { .. } => fill(row, &anisotropic(pair, self.azimuth())),
            }
        }
        out
    }

    /// The same for pairs that a model is to be fitted to. An input that varies by no more than the
    /// rounding of its formula, as where all directions lie at one angle, is made equal in all of
    /// them: what is standardised by its deviation would take the rounding for a feature.
    #[must_use]
    pub fn compute_training(self, pairs: &[DirectionPair]) -> Array2<f64> {
        // Inputs are of order one.
        const ROUNDING: f64 = 1e-12;
        let mut x = self.compute(pairs);
        for mut column in x.columns_mut() {
            let Some(&first) = column.first() else {
                continue;
            };
            if column.iter().all(|value| (value - first).abs() <= ROUNDING) {
                column.fill(first);
            }
        }
        x
    }
}

fn paper(pair: &DirectionPair) -> [f64; 6] {
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

fn half_diff(pair: &DirectionPair) -> [f64; 5] {
    let (l, v) = (pair.incident, pair.outgoing);
    let angles = pair.half_difference();
    [
        angles.theta_h(),
        angles.theta_d(),
        l[2] + v[2],
        l[2] * v[2],
        l[0] * v[0] + l[1] * v[1],
    ]
}

fn cosines(pair: &DirectionPair) -> [f64; 4] {
    let angles = pair.half_difference();
    [
        angles.cos_theta_h(),
        angles.cos_theta_d(),
        pair.incident[2],
        pair.outgoing[2],
    ]
}

fn sum_difference(pair: &DirectionPair) -> [f64; 4] {
    let [cos_h, cos_d, cos_i, cos_o] = cosines(pair);
    [cos_h, cos_d, cos_i + cos_o, cos_o - cos_i]
}

fn reciprocal_cosines(pair: &DirectionPair) -> [f64; 4] {
    let [cos_h, cos_d, cos_i, cos_o] = cosines(pair);
    [cos_h, cos_d, cos_i + cos_o, cos_i * cos_o]
}

fn highlight(pair: &DirectionPair) -> [f64; 4] {
    let angles = pair.half_difference();
    let (cos_i, cos_o) = (pair.incident[2], pair.outgoing[2]);
    [
        angles.theta_h().sqrt(),
        angles.cos_theta_d(),
        cos_i * cos_o,
        cos_i + cos_o,
    ]
}

fn anisotropic(pair: &DirectionPair, azimuth: f64) -> [f64; 6] {
    let [root, cos_d, product, sum] = highlight(pair);
    let pair = pair.turned(-azimuth);
    let (l, v) = (pair.incident, pair.outgoing);
    let (x, y) = (l[0] + v[0], l[1] + v[1]);
    // Along the normal the half vector has no azimuth, and the root is 0.
    let across = (x * x + y * y).max(f64::MIN_POSITIVE);
    [
        root,
        cos_d,
        product,
        sum,
        root * (x * x - y * y) / across,
        root * 2.0 * x * y / across,
    ]
}

fn highlight_cosines(pair: &DirectionPair) -> [f64; 4] {
    let angles = pair.half_difference();
    [
        angles.theta_h().sqrt(),
        angles.cos_theta_d(),
        pair.incident[2],
        pair.outgoing[2],
    ]
}

fn algebraic(pair: &DirectionPair) -> [f64; 3] {
    let angles = pair.half_difference();
    let cosine = angles.cos_theta_d();
    [
        angles.sin_theta_h().sqrt(),
        cosine * cosine,
        pair.incident[2] * pair.outgoing[2],
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
        Error::find("feature set", name, Self::ALL, Self::name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elm_datasets::geometry::cartesian;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6, PI};

    #[test]
    fn the_papers_inputs_at_hand_computed_directions() {
        // Light at 30 degrees, viewer at 60 on the other side: R lies at 30 on the viewer's side,
        // 30 degrees from V.
        let pair = DirectionPair {
            incident: cartesian(FRAC_PI_6, 0.0),
            outgoing: cartesian(FRAC_PI_3, PI),
        };
        let half_root_3 = 3.0_f64.sqrt() / 2.0;
        let expected = [half_root_3, half_root_3, half_root_3, 0.5, 0.5, half_root_3];
        let x = Features::Paper.compute(&[pair]);
        approx::assert_abs_diff_eq!(x, ndarray::arr2(&[expected]), epsilon = 1e-15);
    }

    #[test]
    fn the_other_sets_at_hand_computed_directions() {
        // Retro-reflection at 60 degrees: the half vector is the direction itself.
        let direction = cartesian(FRAC_PI_3, 0.4);
        let pair = DirectionPair {
            incident: direction,
            outgoing: direction,
        };
        let expected: [(Features, &[f64]); 7] = [
            (Features::HalfDiff, &[FRAC_PI_3, 0.0, 1.0, 0.25, 0.75]),
            (Features::Cosines, &[0.5, 1.0, 0.5, 0.5]),
            (Features::SumDifference, &[0.5, 1.0, 1.0, 0.0]),
            (Features::ReciprocalCosines, &[0.5, 1.0, 1.0, 0.25]),
            (Features::Highlight, &[FRAC_PI_3.sqrt(), 1.0, 0.25, 1.0]),
            (
                Features::HighlightCosines,
                &[FRAC_PI_3.sqrt(), 1.0, 0.5, 0.5],
            ),
            (
                Features::Anisotropic { degrees: 0 },
                // The half vector's azimuth is 0.4.
                &[
                    FRAC_PI_3.sqrt(),
                    1.0,
                    0.25,
                    1.0,
                    FRAC_PI_3.sqrt() * 0.8_f64.cos(),
                    FRAC_PI_3.sqrt() * 0.8_f64.sin(),
                ],
            ),
        ];
        for (set, values) in expected {
            let x = set.compute(&[pair]);
            approx::assert_abs_diff_eq!(x.row(0), ndarray::aview1(values), epsilon = 1e-15);
        }
    }

    #[test]
    fn inputs_are_finite_where_directions_coincide_graze_or_oppose() {
        let normal = NORMAL;
        let horizon = cartesian(FRAC_PI_2, 0.0);
        let opposite = [-1.0, 0.0, 0.0];
        let below = [0.0, 0.6, -0.8];
        for incident in [normal, horizon, opposite, below] {
            for outgoing in [normal, horizon, opposite, below] {
                let pair = DirectionPair { incident, outgoing };
                for set in Features::ALL {
                    let x = set.compute(&[pair]);
                    assert_eq!(x.ncols(), set.inputs().len());
                    assert!(x.iter().all(|v| v.is_finite()), "{set} {pair:?}");
                }
            }
        }
    }

    #[test]
    fn an_angle_common_to_all_directions_is_a_constant_input() {
        // Light and viewer turned together: every input is constant, to rounding.
        let pairs: Vec<DirectionPair> = (0..50)
            .map(|turn| DirectionPair {
                incident: cartesian(FRAC_PI_6, 0.1 * f64::from(turn)),
                outgoing: cartesian(FRAC_PI_3, 0.1 * f64::from(turn) + 1.0),
            })
            .collect();
        for set in Features::ALL.into_iter().filter(|set| set.is_isotropic()) {
            let scaler = elm::Scaler::measured(&set.compute_training(&pairs)).unwrap();
            assert!(scaler.factor().iter().all(|f| *f == 0.0), "{set}");
        }
    }

    proptest! {
        #[test]
        fn reciprocal_sets_are_so_to_the_last_bit_and_turns_change_what_they_should(
            theta_i in 0.0..FRAC_PI_2, phi_i in -PI..PI,
            theta_o in 0.0..FRAC_PI_2, phi_o in -PI..PI, turn in -PI..PI,
        ) {
            let pair = |turn: f64, sign: f64| DirectionPair {
                incident: cartesian(theta_i, sign * (phi_i + turn)),
                outgoing: cartesian(theta_o, sign * (phi_o + turn)),
            };
            let original = pair(0.0, 1.0);
            for set in Features::ALL {
                let x = set.compute(&[original]);
                if set.is_reciprocal() {
                    prop_assert_eq!(&x, &set.compute(&[original.swapped()]));
                }
                // Rounding of the azimuths moves the half vector by 1e-15 / cos(theta_d), and
                // the root of an angle by the root of that at most.
                let moved = 4e-15 / original.half_difference().cos_theta_d();
                let has_root = matches!(
                    set,
                    Features::Highlight
                        | Features::HighlightCosines
                        | Features::Algebraic
                        | Features::Anisotropic { .. }
                );
                let tolerance = if has_root { moved.sqrt() } else { moved };
                // A grain looks the same after half a turn.
                let others = if set.is_isotropic() {
                    vec![pair(turn, 1.0), pair(turn, -1.0)]
                } else {
                    vec![pair(PI, 1.0)]
                };
                for other in others {
                    let other = set.compute(&[other]);
                    prop_assert!(x.iter().zip(&other).all(|(a, b)| (a - b).abs() <= tolerance));
                }
            }
        }
    }

    #[test]
    fn names_are_read_back() {
        for set in Features::ALL {
            assert_eq!(set.name().parse::<Features>().unwrap(), set);
        }
        assert!("six".parse::<Features>().is_err());
    }
}
