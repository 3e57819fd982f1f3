//! Activation functions: the $f$ of equation 7, applied to every entry of $XW + b$.

mod apply;
mod formulas;
#[cfg(test)]
mod tests_vector;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use ndarray::ArrayViewMut2;
#[cfg(feature = "serde")]
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::Error;
use crate::scalar::Scalar;
use crate::simd::Level;

/// The function that a hidden neuron applies to its weighted sum $z = w \cdot x + b$.
///
/// An enum rather than a type parameter: a fitted network keeps one type, serializes its
/// activation as a name, and can be chosen at run time. Your own function goes in through
/// [`Activation::custom`].
///
/// ```
/// use elm::Activation;
///
/// let named: Activation<f64> = "tanh".parse()?;
/// assert_eq!(named, Activation::Tanh);
/// let own = Activation::custom("softplus", |z: f64| z.exp().ln_1p());
/// assert!((own.apply(0.0) - 2.0_f64.ln()).abs() < 1e-15);
/// # Ok::<(), elm::Error>(())
/// ```
///
/// ```
/// use elm::{Activation, ElmParams};
/// use ndarray::array;
///
/// let (x, t) = (array![[-2.0], [-1.0], [0.0], [1.0], [2.0]], array![-8.0, -1.0, 0.0, 1.0, 8.0]);
/// let by_name: Activation<f64> = "sine".parse()?;
/// let own = Activation::custom("cube", |z: f64| z * z * z);
/// for activation in [by_name, own] {
///     let model = ElmParams::new(10).with_activation(activation).fit(&x, &t)?;
///     assert!((model.predict(&x)?[4] - 8.0).abs() < 0.5);
/// }
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Clone, Default)]
#[non_exhaustive]
pub enum Activation<A: Scalar> {
    /// $1 / (1 + e^{-z})$, the usual choice of the ELM literature and of the paper.
    #[default]
    Sigmoid,
    /// $\tanh z$.
    Tanh,
    /// $\sin z$.
    Sine,
    /// $e^{-z^2}$.
    Gaussian,
    /// $\max(0, z)$.
    Relu,
    /// $\max(0, z)^2$ (So et al., *Primer: Searching for Efficient Transformers*, 2021): one
    /// multiplication more than [`Relu`](Self::Relu), and without its kink.
    SquaredRelu,
    /// 1 where $z \ge 0$, else 0.
    HardLimit,
    /// $z / \sqrt{1 + z^2}$, the inverse square root unit (ISRU) of Carlile et al., *Improving Deep
    /// Learning by Inverse Square Root Linear Units* (2017): the shape of $\tanh$, without an
    /// exponential.
    Isru,
    /// $z$ itself; the network is then a linear model.
    Linear,
    /// A function of the user's own.
    Custom(Custom<A>),
}

/// A user's activation function with the name that it is known by.
#[derive(Clone)]
pub struct Custom<A> {
    name: String,
    function: Arc<dyn Fn(A) -> A + Send + Sync>,
}

/// How exactly activation functions are evaluated.
///
/// The bounds are tested over the whole range of arguments, `f32` against `f64` and `f64` against
/// 57-digit arithmetic. The largest errors found are 4.3 units in the last place (tanh; 2.9 in the
/// other functions) and, for `Fast`, 4.5e-7.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Accuracy {
    /// To within 5 units in the last place, or one subnormal step where a result is subnormal.
    #[default]
    Full,
    /// To within an absolute error of 6e-7, at a lower cost in `f64`: sigmoid, tanh, sine and
    /// Gaussian are approximated more coarsely. Small values lose their relative accuracy. In
    /// `f32`, where full accuracy is cheap, sine and Gaussian are as in `Full`; so are the other
    /// functions.
    Fast,
}

impl<A: Scalar> Activation<A> {
    /// The built-in functions.
    pub const BUILT_IN: [Self; 9] = [
        Self::Sigmoid,
        Self::Tanh,
        Self::Sine,
        Self::Gaussian,
        Self::Relu,
        Self::SquaredRelu,
        Self::HardLimit,
        Self::Isru,
        Self::Linear,
    ];

    /// The names of the built-in functions, as [`FromStr`] reads them.
    pub const NAMES: &'static str =
        "sigmoid, tanh, sine, gaussian, relu, squared-relu, hard-limit, isru, linear";

    /// A function of the user's own, which must be finite for finite arguments.
    pub fn custom<F>(name: impl Into<String>, function: F) -> Self
    where
        F: Fn(A) -> A + Send + Sync + 'static,
    {
        Self::Custom(Custom {
            name: name.into(),
            function: Arc::new(function),
        })
    }

    /// The function's name.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Sigmoid => "sigmoid",
            Self::Tanh => "tanh",
            Self::Sine => "sine",
            Self::Gaussian => "gaussian",
            Self::Relu => "relu",
            Self::SquaredRelu => "squared-relu",
            Self::HardLimit => "hard-limit",
            Self::Isru => "isru",
            Self::Linear => "linear",
            Self::Custom(custom) => &custom.name,
        }
    }

    /// The function's value at `z`. NaN stays NaN.
    ///
    /// By the standard library; fitting and predicting use vector code, which agrees to the
    /// error that [`Accuracy`] states.
    #[must_use]
    pub fn apply(&self, z: A) -> A {
        match self {
            Self::Sigmoid => sigmoid(z),
            Self::Tanh => z.tanh(),
            Self::Sine => z.sin(),
            Self::Gaussian => (-(z * z)).exp(),
            Self::Relu => relu(z),
            Self::SquaredRelu => relu(z) * relu(z),
            Self::HardLimit => hard_limit(z),
            Self::Isru => isru(z),
            Self::Linear => z,
            Self::Custom(custom) => (custom.function)(z),
        }
    }

    /// Applies the function to every value, by vector code, to within [`Accuracy::Full`].
    pub fn apply_to(&self, values: &mut [A]) {
        self.apply_to_slice(Level::best(), Accuracy::Full, values);
    }

    /// Applies the function to every value, by vector code.
    pub(crate) fn apply_to_slice(&self, level: Level, accuracy: Accuracy, values: &mut [A]) {
        match self {
            Self::Linear => {}
            Self::Custom(custom) => {
                for value in values {
                    *value = (custom.function)(*value);
                }
            }
            built_in => apply::apply(level, built_in, accuracy, values),
        }
    }

    /// Applies the function to every entry, as [`apply_to`](Self::apply_to) where they lie without gaps.
    pub fn apply_in_place(&self, mut z: ArrayViewMut2<'_, A>) {
        let level = Level::best();
        if let Some(values) = z.as_slice_memory_order_mut() {
            return self.apply_to_slice(level, Accuracy::Full, values);
        }
        z.mapv_inplace(|z| self.apply(z));
    }
}

// e^{-|z|} cannot overflow, and both tails keep their relative accuracy.
fn sigmoid<A: Scalar>(z: A) -> A {
    let e = (-z.abs()).exp();
    let upper = A::one() / (A::one() + e);
    if z < A::zero() { e * upper } else { upper }
}

// Scaled so that no square leaves the range.
fn isru<A: Scalar>(z: A) -> A {
    if z.abs() > A::one() {
        let inverse = z.recip();
        z.signum() / (A::one() + inverse * inverse).sqrt()
    } else {
        z / (A::one() + z * z).sqrt()
    }
}

fn relu<A: Scalar>(z: A) -> A {
    if z < A::zero() { A::zero() } else { z }
}

fn hard_limit<A: Scalar>(z: A) -> A {
    if z >= A::zero() {
        A::one()
    } else if z < A::zero() {
        A::zero()
    } else {
        z
    }
}

impl<A: Scalar> PartialEq for Activation<A> {
    /// Built-in functions are equal by kind, custom ones when they are clones of each other.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Custom(a), Self::Custom(b)) => Arc::ptr_eq(&a.function, &b.function),
            (Self::Custom(_), _) | (_, Self::Custom(_)) => false,
            _ => self.name() == other.name(),
        }
    }
}

impl<A: Scalar> fmt::Debug for Activation<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Activation({})", self.name())
    }
}

impl<A> fmt::Debug for Custom<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Custom")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl<A: Scalar> fmt::Display for Activation<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl<A: Scalar> FromStr for Activation<A> {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::BUILT_IN
            .into_iter()
            .find(|built_in| built_in.name() == name)
            .ok_or_else(|| Error::UnknownName {
                what: "activation",
                name: name.to_owned(),
                expected: Self::NAMES,
            })
    }
}

#[cfg(feature = "serde")]
impl<A: Scalar> Serialize for Activation<A> {
    /// By name; a custom function is code, which no file holds, and might have the name of another.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if let Self::Custom(custom) = self {
            return Err(serde::ser::Error::custom(format_args!(
                "the activation '{}' is custom and cannot be written to a file",
                custom.name
            )));
        }
        serializer.serialize_str(self.name())
    }
}

#[cfg(feature = "serde")]
impl<'de, A: Scalar> Deserialize<'de> for Activation<A> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_agree_with_hand_computed_ones() {
        // (function, z, f(z)); the transcendental values to 16 digits from their series.
        let table: [(Activation<f64>, f64, f64); 17] = [
            (Activation::Sigmoid, 0.0, 0.5),
            (Activation::Sigmoid, 1.0, 0.731_058_578_630_004_9),
            (Activation::Sigmoid, -1.0, 0.268_941_421_369_995_1),
            (Activation::Sigmoid, -700.0, 9.859_676_543_759_77e-305),
            (Activation::Sigmoid, 800.0, 1.0),
            (Activation::Tanh, 0.5, 0.462_117_157_260_009_8),
            (Activation::Sine, std::f64::consts::FRAC_PI_6, 0.5),
            (Activation::Gaussian, 1.0, 0.367_879_441_171_442_3),
            (Activation::Gaussian, 1e200, 0.0),
            (Activation::Relu, -2.0, 0.0),
            (Activation::Relu, 2.0, 2.0),
            (Activation::SquaredRelu, -2.0, 0.0),
            (Activation::SquaredRelu, 3.0, 9.0),
            (Activation::HardLimit, 0.0, 1.0),
            (Activation::HardLimit, -0.0, 1.0),
            (Activation::HardLimit, -1e-300, 0.0),
            (Activation::Linear, -3.25, -3.25),
        ];
        for (function, z, expected) in table {
            approx::assert_relative_eq!(function.apply(z), expected, max_relative = 4e-15);
        }
    }

    #[test]
    fn nan_stays_nan_in_every_built_in_function() {
        for function in Activation::<f64>::BUILT_IN {
            assert!(function.apply(f64::NAN).is_nan(), "{function}");
        }
    }

    #[test]
    fn the_matrix_form_agrees_with_the_scalar_form() {
        let own = Activation::custom("cube", |z: f64| z * z * z);
        for function in Activation::BUILT_IN.into_iter().chain([own]) {
            let z = ndarray::Array2::from_shape_fn((3, 5), |(i, j)| (i as f64 - 1.0) * j as f64);
            let mut matrix = z.clone();
            function.apply_in_place(matrix.view_mut());
            // 5 units of the vector code and 1 of the standard library.
            approx::assert_relative_eq!(
                matrix,
                z.mapv(|z| function.apply(z)),
                max_relative = 6.0 * f64::EPSILON,
                epsilon = f64::MIN_POSITIVE
            );
        }
    }

    #[test]
    fn names_are_read_back_and_an_unknown_one_is_named() {
        for function in Activation::<f32>::BUILT_IN {
            assert_eq!(
                function.name().parse::<Activation<f32>>().unwrap(),
                function
            );
            assert!(Activation::<f32>::NAMES.contains(function.name()));
        }
        let error = "softmax".parse::<Activation<f64>>().unwrap_err();
        assert!(error.to_string().contains("'softmax'"), "{error}");
    }
}
