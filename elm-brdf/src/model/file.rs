//! A model as its file has it: what was chosen and fitted, and nothing that can be made again.

use elm::advanced::FeatureMap;
use elm::persist::{self, Persist};
use elm::{Activation, Elm, Scaler};
use ndarray::{Array1, Array2};
use serde::{Deserialize, Serialize};

use super::{BrdfModel, Layer, Provenance};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::target_transform::FittedTransform;

#[derive(Serialize, Deserialize)]
pub(super) struct File {
    provenance: Provenance,
    features: Features,
    transform: FittedTransform,
    layer: Layer,
    scaler: Option<Scaler<f64>>,
    direct_links: bool,
    beta: Array2<f64>,
    intercept: Array1<f64>,
}

impl From<BrdfModel> for File {
    fn from(model: BrdfModel) -> Self {
        Self {
            provenance: model.provenance,
            features: model.features,
            transform: model.transform,
            layer: model.layer,
            scaler: model.network.scaler().cloned(),
            direct_links: model.network.map().direct_links(),
            beta: model.network.beta().to_owned(),
            intercept: model.network.intercept().to_owned(),
        }
    }
}

impl TryFrom<File> for BrdfModel {
    type Error = Error;

    fn try_from(file: File) -> Result<Self> {
        let inputs = file.features.inputs().len();
        let links = if file.direct_links { inputs } else { 0 };
        // Of a file that lies there may be fewer rows than links.
        let neurons = file.beta.nrows().saturating_sub(links);
        let hidden = file.layer.hidden(inputs, neurons)?;
        let map = FeatureMap::new(file.scaler, hidden, file.direct_links)?;
        let network = Elm::from_parts(map, file.beta, file.intercept)?;
        for (what, expected, found) in [
            ("inputs of the network", inputs, network.inputs()),
            (
                "outputs of the transform",
                network.outputs(),
                file.transform.outputs(),
            ),
        ] {
            if expected != found {
                return Err(Error::Shape {
                    what,
                    expected,
                    found,
                });
            }
        }
        file.transform.check()?;
        Ok(Self {
            provenance: file.provenance,
            features: file.features,
            transform: file.transform,
            layer: file.layer,
            network,
        })
    }
}

impl Persist for BrdfModel {
    const KIND: &'static str = "elm-brdf model";
    const SCALAR: &'static str = "f64";
    const VERSION: u32 = 4;

    fn check(&self) -> Result<(), persist::Error> {
        let groups = self.network.hidden().groups();
        match groups
            .iter()
            .find(|g| matches!(g.activation(), Activation::Custom(_)))
        {
            Some(group) => Err(persist::Error::CustomActivation {
                name: group.activation().name().to_owned(),
            }),
            None => Ok(()),
        }
    }
}
