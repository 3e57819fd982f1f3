//! What a network is made of, for those who build networks of their own: feature maps that are drawn,
//! joined or pruned before [output weights](crate::ElmParams::fit_map) are found for them.
//!
//! ```
//! use elm::advanced::FeatureMap;
//! use elm::{Dataset, ElmParams, Scaler};
//! use ndarray::{Array1, Axis};
//!
//! let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
//! let t = x.column(0).mapv(f64::sin);
//! let params = ElmParams::new(20);
//! let layer = params.feature_map().draw(1)?;
//! let map = FeatureMap::new(Some(Scaler::measured(&x)?), layer, false)?;
//! let model = params.fit_map(map, &Dataset::new(&x, &t)?)?;
//! assert_eq!(model, params.fit(&x, &t)?);
//! # Ok::<(), elm::Error>(())
//! ```

pub use crate::feature_map::{FeatureMap, FeatureMapParams, HiddenLayer, NeuronBlock};
pub use crate::stream::Stream;
pub use crate::threads::map as parallel_map;
