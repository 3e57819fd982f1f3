//! Extreme learning machines: regression and classification by a hidden layer of random neurons and one
//! linear solve.
//!
//! A network with one hidden layer computes $o(x) = \sum_k \beta_k f(\omega_k \cdot x + b_k)$.
//! An extreme learning machine draws $\omega$ and $b$ at random, never trains them, and finds the
//! output weights $\beta$ by linear least squares. Fitting is a matrix factorization: it takes
//! milliseconds, has no learning rate, and has one answer.
//!
//! ```
//! use elm::ElmParams;
//! use ndarray::array;
//!
//! let x = array![[0.0], [0.5], [1.0], [1.5], [2.0]];
//! let t = array![0.0, 0.25, 1.0, 2.25, 4.0];
//! let model = ElmParams::new(20).fit(&x, &t)?;
//! let y = model.predict(&array![[1.2]])?;
//! assert!((y[0] - 1.44_f64).abs() < 0.1);
//! # Ok::<(), elm::Error>(())
//! ```
//!
//! - [`ElmParams`] holds the settings, [`Elm`] the fitted network, [`Predictor`]
//!   its weights packed for evaluation.
//! - [`Activation`] is the neurons' function, one of nine or your own; [`NodeType`] says what it is
//!   applied to, a weighted sum or the distance from a center. Several [`NeuronGroup`]s may
//!   stand in one layer.
//! - [`solve`] has the solvers: equations 10 and 11 of the ELM literature, and ridge regression
//!   with $\lambda$ chosen by exact leave-one-out, which is the default.
//! - [`Dataset`] is what networks are fitted to: inputs, targets, weights and groups of rows.
//! - [`cross_validation`] has held-out predictions in closed form, leave-one-out and k-fold.
//! - [`Accumulator`] fits to rows that arrive in pieces.
//! - [`prune`] keeps the most useful of many neurons.
//! - [`tune`] chooses scale, neurons and inputs; [`uncertainty`] says how far a prediction can be
//!   trusted; [`persist`] keeps a network in a file.
//! - [`classify`] makes classifiers with calibrated probabilities of the same settings.
//! - [`metrics`] has RMSE, MAE, $R^2$ and correlation; of classes accuracy, log loss and others.
//! - [`advanced`] has the parts of a network, [`ndarray`] is the version that this crate is built with.
//!
//! Everything is generic over [`Scalar`], `f32` or `f64`. No input makes the public API panic:
//! what cannot be fitted or predicted is an [`Error`] that names the place.
//!
//! # Reproducibility
//! One seed draws one random layer, bit for bit, on every platform. Work is cut into parts by sizes alone, so
//! that no digit depends on the number of threads; between processors with different vector units results
//! agree to rounding error.
//!
//! # Features
//! - `faer` (default): linear algebra in pure Rust.
//! - `openblas-system`: LAPACK from the system's OpenBLAS, in place of faer. OpenBLAS is set to one
//!   thread for the whole process: its parallel routines overflow the stack of a Rust thread.
//! - `persist` (default): files, [`persist`].
//! - `serde`: settings, networks and what they consist of in any format of serde; part of `persist`.
//! - `onnx`: networks and classifiers as ONNX files, `elm::onnx`.
//! - `rayon` (default): all cores where that pays, or as many threads as [`on_threads`] says; without it
//!   everything runs on the thread that asks.

pub mod accumulate;
pub mod activation;
pub mod advanced;
pub mod bounds;
mod check;
pub mod classify;
pub mod cross_validation;
mod dataset;
mod error;
mod feature_map;
#[cfg(shares_generics)]
#[doc(hidden)]
pub mod instances;
mod linalg;
mod memory;
pub mod metrics;
mod model;
mod network;
#[cfg(feature = "serde")]
mod numbers;
#[cfg(feature = "onnx")]
pub mod onnx;
#[cfg(feature = "persist")]
pub mod persist;
mod predictor;
pub mod prune;
mod scalar;
mod simd;
pub mod solve;
mod stats;
mod stream;
mod threads;
pub mod tune;
pub mod uncertainty;

pub use accumulate::Accumulator;
pub use activation::{Accuracy, Activation};
pub use bounds::Bounds;
pub use classify::ElmClassifier;
pub use dataset::{Dataset, Inputs, TargetDim, Targets};
pub use error::{Error, Result};
pub use feature_map::{
    Biases, Distribution, Embedding, NeuronGroup, NodeType, Ramps, Scaler, ScalerBuilder,
};
pub use linalg::backend;
pub use model::ElmParams;
pub use ndarray;
pub use network::Elm;
pub use predictor::{Predictor, Scratch};
pub use scalar::Scalar;
pub use threads::{current_threads, on_this_thread, on_threads};
pub use tune::Tuner;
pub use uncertainty::UncertainElm;

// The README's code is compiled and run with the documentation tests.
#[cfg(all(doctest, feature = "persist"))]
#[doc = include_str!("../README.md")]
struct Readme;
