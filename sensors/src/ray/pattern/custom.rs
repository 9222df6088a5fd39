//! User-defined rays.

use super::{PatternImpl, UnnormalizedRay};
use crate::ray::RayError;
use serde::{Deserialize, Serialize};

/// User-defined rays, in the frame of the sensor; both lists have the same length.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Custom {
    /// Origins of the rays \[m\].
    pub starts: Vec<[f64; 3]>,
    /// Directions of the rays, of any length except zero.
    pub directions: Vec<[f64; 3]>,
}

impl PatternImpl for Custom {
    fn count(&self) -> f64 {
        if self.starts.len() == self.directions.len() { self.starts.len() as f64 } else { f64::NAN }
    }

    fn rays(&self) -> Result<Vec<UnnormalizedRay>, RayError> {
        let (starts, directions) = (self.starts.len(), self.directions.len());
        if starts != directions {
            return Err(RayError::Lengths { starts, directions });
        }
        Ok(self.starts.iter().copied().zip(self.directions.iter().copied()).collect())
    }
}
