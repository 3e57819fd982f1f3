//! The covariances of the limit: at the rows of two matrices, with their derivatives.

use elm::{Activation, Distribution};
use ndarray::{Array2, Axis, Zip};

/// How smooth the limit is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Smoothness {
    /// Matérn's covariance 5/2: two derivatives.
    Twice,
    /// The normal covariance: all derivatives.
    Infinite,
}

impl Smoothness {
    pub(super) const ALL: [Self; 2] = [Self::Twice, Self::Infinite];

    /// The distribution of the neurons' frequencies.
    pub(super) fn frequencies(self) -> Distribution {
        match self {
            Self::Twice => Distribution::StudentT(5),
            Self::Infinite => Distribution::Normal,
        }
    }
}

/// What the covariance of the rows of two matrices is made of.
pub(super) struct Decay {
    smoothness: Smoothness,
    /// $r = \sqrt 5 d$ of Matérn's covariance, $d^2 / 2$ of the normal one, where rows are $d$ apart.
    distance: Array2<f64>,
    /// $e^{-r}$, or $e^{-d^2 / 2}$.
    decay: Array2<f64>,
}

impl Decay {
    pub(super) fn between(smoothness: Smoothness, a: &Array2<f64>, b: &Array2<f64>) -> Self {
        let mut distance = squared_distances(a, b);
        match smoothness {
            Smoothness::Twice => distance.mapv_inplace(|squared| (5.0 * squared).sqrt()),
            Smoothness::Infinite => distance *= 0.5,
        }
        // Of the roots, so that vector code computes the exponentials.
        let mut decay = distance.mapv(f64::sqrt);
        Activation::Gaussian.apply_in_place(decay.view_mut());
        Self {
            smoothness,
            distance,
            decay,
        }
    }

    pub(super) fn correlations(&self) -> Array2<f64> {
        match self.smoothness {
            Smoothness::Twice => Zip::from(&self.distance)
                .and(&self.decay)
                .map_collect(|r, decay| (1.0 + r + r * r / 3.0) * decay),
            Smoothness::Infinite => self.decay.clone(),
        }
    }

    /// Multiplies `w` by the derivatives of the correlations with respect to half the squared distances.
    pub(super) fn scale_by_slopes(&self, w: &mut Array2<f64>) {
        match self.smoothness {
            Smoothness::Twice => Zip::from(w)
                .and(&self.distance)
                .and(&self.decay)
                .for_each(|w, r, decay| *w *= -5.0 / 3.0 * (1.0 + r) * decay),
            Smoothness::Infinite => *w *= &-&self.decay,
        }
    }
}

/// Squared distances of the rows of `a` and those of `b`.
fn squared_distances(a: &Array2<f64>, b: &Array2<f64>) -> Array2<f64> {
    let squares = |x: &Array2<f64>| x.map_axis(Axis(1), |row| row.dot(&row));
    let (of_a, of_b) = (squares(a), squares(b));
    let mut out = a.dot(&b.t());
    for (mut row, a) in out.rows_mut().into_iter().zip(&of_a) {
        row.zip_mut_with(&of_b, |product, b| {
            *product = (a + b - 2.0 * *product).max(0.0);
        });
    }
    out
}
