//! Reads and writes settings: [`ElmParams`] as JSON and in binary.
//!
//! Where people read it every setting has the name of its setter, and one that is missing its default:
//! `{"neurons": 20}` will do. Binary forms, which know no names, have all fields in order.

use serde::de::{self, Deserializer, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::ser::{Error as _, Serializer};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::marker::PhantomData;

use super::ElmParams;
use crate::activation::Activation;
use crate::error::Error;
use crate::feature_map::{
    Biases, Distribution, Embedding, FeatureMapParams, NeuronGroup, NodeType,
};
use crate::scalar::Scalar;
use crate::solve::Solver;

/// In order, without names.
#[derive(Serialize, Deserialize)]
#[serde(bound = "", rename = "ElmParams")]
struct Fields<A: Scalar> {
    map: FeatureMapParams<A>,
    solver: Solver,
    intercept: Option<bool>,
    bounded: bool,
}

/// By the names of the setters.
#[derive(Serialize, Deserialize)]
#[serde(bound = "", rename = "ElmParams", deny_unknown_fields)]
struct Named<A: Scalar> {
    neurons: Count<A>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    activation: Option<Activation<A>>,
    #[serde(default, alias = "kind", skip_serializing_if = "Option::is_none")]
    node_type: Option<NodeType>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    biases: Option<Biases>,
    #[serde(
        default,
        alias = "and",
        alias = "others",
        skip_serializing_if = "Vec::is_empty"
    )]
    groups: Vec<NeuronGroup<A>>,
    #[serde(default)]
    distribution: Distribution,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    input_scales: Vec<f64>,
    #[serde(default)]
    seed: u64,
    #[serde(default)]
    solver: Solver,
    #[serde(default)]
    intercept: Option<bool>,
    #[serde(default = "yes", alias = "standardise")]
    standardize: bool,
    #[serde(default)]
    direct_links: bool,
    #[serde(default)]
    embedding: Embedding<A>,
    #[serde(default = "yes")]
    bounded: bool,
}

fn one() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

/// The number of neurons or, as in older files, all settings of the neurons.
enum Count<A: Scalar> {
    Number(usize),
    Neurons(NeuronGroup<A>),
}

impl<A: Scalar> Serialize for Count<A> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Number(count) => count.serialize(serializer),
            Self::Neurons(neurons) => neurons.serialize(serializer),
        }
    }
}

impl<'de, A: Scalar> Deserialize<'de> for Count<A> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either<A>(PhantomData<A>);
        impl<'de, A: Scalar> Visitor<'de> for Either<A> {
            type Value = Count<A>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of neurons")
            }

            fn visit_u64<E: de::Error>(self, count: u64) -> Result<Self::Value, E> {
                let number = usize::try_from(count).map_err(E::custom)?;
                Ok(Count::Number(number))
            }

            fn visit_i64<E: de::Error>(self, count: i64) -> Result<Self::Value, E> {
                let number = usize::try_from(count).map_err(E::custom)?;
                Ok(Count::Number(number))
            }

            fn visit_map<M: MapAccess<'de>>(self, map: M) -> Result<Self::Value, M::Error> {
                let neurons = NeuronGroup::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Count::Neurons(neurons))
            }
        }
        deserializer.deserialize_any(Either(PhantomData))
    }
}

impl<A: Scalar> Serialize for ElmParams<A> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // JSON would make null of it, and nothing could be read from that.
        if let Err(error @ Error::Parameter { value, .. }) = self.check()
            && !value.is_finite()
        {
            return Err(S::Error::custom(error));
        }
        let own = self.clone();
        if !serializer.is_human_readable() {
            return Fields::from(own).serialize(serializer);
        }
        let FeatureMapParams { neurons, .. } = own.map;
        let plain = neurons.scale == 1.0;
        let named = Named {
            activation: plain.then(|| neurons.activation.clone()),
            node_type: plain.then_some(neurons.node_type),
            biases: plain.then_some(neurons.biases),
            neurons: if plain {
                Count::Number(neurons.count)
            } else {
                Count::Neurons(neurons)
            },
            groups: own.map.others,
            distribution: own.map.distribution,
            scale: own.map.scale,
            input_scales: own.map.input_scales,
            seed: own.map.seed,
            solver: own.solver,
            intercept: own.intercept,
            standardize: own.map.standardize,
            direct_links: own.map.direct_links,
            embedding: own.map.embedding,
            bounded: own.bounded,
        };
        named.serialize(serializer)
    }
}

impl<'de, A: Scalar> Deserialize<'de> for ElmParams<A> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            Named::deserialize(deserializer).map(Self::from)
        } else {
            Fields::deserialize(deserializer).map(Self::from)
        }
    }
}

impl<A: Scalar> From<Named<A>> for ElmParams<A> {
    fn from(named: Named<A>) -> Self {
        let mut neurons = match named.neurons {
            Count::Number(count) => NeuronGroup::new(count, Activation::default()),
            Count::Neurons(neurons) => neurons,
        };
        if let Some(activation) = named.activation {
            neurons.activation = activation;
        }
        if let Some(node_type) = named.node_type {
            neurons.node_type = node_type;
        }
        if let Some(biases) = named.biases {
            neurons.biases = biases;
        }
        Self {
            map: FeatureMapParams {
                neurons,
                others: named.groups,
                distribution: named.distribution,
                scale: named.scale,
                input_scales: named.input_scales,
                seed: named.seed,
                standardize: named.standardize,
                direct_links: named.direct_links,
                embedding: named.embedding,
            },
            solver: named.solver,
            intercept: named.intercept,
            bounded: named.bounded,
        }
    }
}

impl<A: Scalar> From<Fields<A>> for ElmParams<A> {
    fn from(fields: Fields<A>) -> Self {
        Self {
            map: fields.map,
            solver: fields.solver,
            intercept: fields.intercept,
            bounded: fields.bounded,
        }
    }
}

impl<A: Scalar> From<ElmParams<A>> for Fields<A> {
    fn from(params: ElmParams<A>) -> Self {
        Self {
            map: params.map,
            solver: params.solver,
            intercept: params.intercept,
            bounded: params.bounded,
        }
    }
}
