//! Learns measured reflectance (BRDF) with extreme learning machines, and reproduces on the CUReT
//! database the paper
//!
//! > S. Kartal, *Extreme Learning Machine based Bidirectional Reflectance Distribution
//! > Approximation*, International Journal of Advanced Research in Computer Science and Software
//! > Engineering 7(3), 2017.
//!
//! Data run one way: measurements ([`elm_datasets`]) to network inputs ([`features`]) and targets
//! ([`target_transform`]), through a network ([`elm`]) to a reflectance model ([`model`]), which
//! cross-validation ([`protocol`]) judges beside what the paper printed ([`published`]).
//!
//! Of the features `cli` (the program `elm-brdf`, default) brings `report` (results as tables, files
//! and pictures) and `render` (scenes with learnt materials); without it the library knows no command
//! line, picture or scene. `fetch` adds the command that asks for the CUReT files over HTTP.
//!
//! ```
//! use elm_brdf::{model::BrdfParams, protocol};
//! use elm_datasets::{Invalid, MaterialId, synthetic};
//!
//! let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
//! let paper = BrdfParams::paper(50);
//! let folds = protocol::Folds::new(data.directions.len(), 10, 1)?;
//! let scores = protocol::cross_validate(&paper, &data, &folds, |_, _| {})?;
//! let red = &scores[0].channels[0];
//! assert!(red.held_out.rmse > red.train.rmse);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod albedo;
pub mod baselines;
mod basis;
pub mod batch;
#[cfg(feature = "cli")]
pub mod cli;
mod error;
pub mod export;
pub mod features;
#[cfg(feature = "fetch")]
pub mod fetch;
#[cfg(any(feature = "render", feature = "report"))]
mod file;
pub mod fit;
#[cfg(feature = "render")]
pub mod gallery;
pub mod metrics;
pub mod model;
pub mod pareto;
pub mod prior;
pub mod protocol;
pub mod published;
pub mod quality;
pub mod recipes;
pub mod registry;
#[cfg(feature = "report")]
pub mod report;
mod scales;
#[cfg(feature = "render")]
pub mod scene_materials;
#[cfg(feature = "render")]
pub mod scenes;
mod statistics;
mod streams;
pub mod target_transform;

/// The renderer.
#[cfg(feature = "render")]
pub use elm_brdf_render as render;
pub use error::{Error, Result};

// The README's code is compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
