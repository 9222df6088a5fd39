//! Representations of values in configuration files: modules for serde's `with`.
//!
//! | value | in a file |
//! |---|---|
//! | pose | `[x, y, z, qw, qx, qy, qz]`, or `{ pos = [x, y, z], rpy_deg = [r, p, y] }`, or with `quat_wxyz` |
//! | rotation | `[w, x, y, z]`, or `{ rpy_deg = [r, p, y] }` |
//! | vector | `[x, y, z]` |
//! | optional vector | `[x, y, z]`; the empty value of the format (null in JSON) for `None` |
//! | list of pairs | a table that keeps its order |
//! | optional value with a default | the value; `false` for `None` |

use nalgebra::UnitQuaternion;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt;
use std::marker::PhantomData;

/// Rotation of a quaternion `[w, x, y, z]`, which is normalized; an error if it is zero or not finite. A unit
/// quaternion keeps its bits, so that a written value is read back exactly.
fn quaternion<E: Error>([w, x, y, z]: [f64; 4]) -> Result<UnitQuaternion<f64>, E> {
    let quaternion = nalgebra::Quaternion::new(w, x, y, z);
    let length = quaternion.norm();
    if !(length.is_finite() && length > 1e-9) {
        return Err(E::custom(format_args!(
            "[{w}, {x}, {y}, {z}] is not a rotation: a quaternion w, x, y, z must be finite and not zero"
        )));
    }
    // Normalizing leaves an error of a few units in the last place. Normalizing again would change these bits.
    let is_unit = (length - 1.0).abs() < 8.0 * f64::EPSILON;
    Ok(if is_unit { UnitQuaternion::new_unchecked(quaternion) } else { UnitQuaternion::new_normalize(quaternion) })
}

/// Rotation of roll, pitch and yaw \[deg\] about fixed axes, as in URDF.
fn roll_pitch_yaw(degrees: [f64; 3]) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = degrees.map(f64::to_radians);
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

/// Representation of [`Pose`](crate::Pose).
pub mod pose {
    use super::*;
    use crate::Pose;
    use crate::pose::to_row;
    use nalgebra::Translation3;

    /// Writes `[x, y, z, qw, qx, qy, qz]`.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<S: Serializer>(pose: &Pose, serializer: S) -> Result<S::Ok, S::Error> {
        to_row(pose).serialize(serializer)
    }

    /// Reads an array or a table. In a table, a missing `pos` is 0 and a missing rotation is the identity. Quaternions
    /// are normalized.
    ///
    /// # Errors
    /// The value has another form or two rotations, or the quaternion is zero or not finite.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Pose, D::Error> {
        deserializer.deserialize_any(Row)
    }

    struct Row;

    #[derive(serde::Deserialize)]
    #[serde(default, deny_unknown_fields)]
    struct Parts {
        pos: [f64; 3],
        quat_wxyz: Option<[f64; 4]>,
        rpy_deg: Option<[f64; 3]>,
    }

    impl Default for Parts {
        fn default() -> Self {
            Self { pos: [0.0; 3], quat_wxyz: None, rpy_deg: None }
        }
    }

    impl<'de> Visitor<'de> for Row {
        type Value = Pose;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a pose: [x, y, z, qw, qx, qy, qz], or a table of pos with rpy_deg or quat_wxyz")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Pose, A::Error> {
            let [x, y, z, rotation @ ..] = <[f64; 7]>::deserialize(SeqAccessDeserializer::new(seq))?;
            Ok(Pose::from_parts(Translation3::new(x, y, z), quaternion(rotation)?))
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Pose, A::Error> {
            let parts = Parts::deserialize(MapAccessDeserializer::new(map))?;
            let rotation = match (parts.quat_wxyz, parts.rpy_deg) {
                (Some(_), Some(_)) => return Err(A::Error::custom("a pose has quat_wxyz or rpy_deg, not both")),
                (Some(wxyz), None) => quaternion(wxyz)?,
                (None, Some(degrees)) => roll_pitch_yaw(degrees),
                (None, None) => UnitQuaternion::identity(),
            };
            Ok(Pose::from_parts(Translation3::from(parts.pos), rotation))
        }
    }
}

/// Representation of [`UnitQuaternion`].
pub mod rotation {
    use super::*;
    use crate::pose::to_wxyz;

    /// Writes `[w, x, y, z]`.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<S: Serializer>(rotation: &UnitQuaternion<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        to_wxyz(rotation).serialize(serializer)
    }

    /// Reads a quaternion `[w, x, y, z]` and normalizes it, or `{ rpy_deg = [r, p, y] }`: angles about fixed axes, as
    /// in URDF \[deg\].
    ///
    /// # Errors
    /// The value has another form, or the quaternion is zero or not finite.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<UnitQuaternion<f64>, D::Error> {
        deserializer.deserialize_any(Wxyz)
    }

    struct Wxyz;

    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Angles {
        rpy_deg: [f64; 3],
    }

    impl<'de> Visitor<'de> for Wxyz {
        type Value = UnitQuaternion<f64>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a rotation: [w, x, y, z] or { rpy_deg = [roll, pitch, yaw] }")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
            quaternion(<[f64; 4]>::deserialize(SeqAccessDeserializer::new(seq))?)
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            Angles::deserialize(MapAccessDeserializer::new(map)).map(|angles| roll_pitch_yaw(angles.rpy_deg))
        }
    }
}

/// Representation of [`nalgebra::Vector3`].
pub mod vector {
    use super::*;
    use nalgebra::Vector3;

    /// Writes `[x, y, z]`.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<S: Serializer>(vector: &Vector3<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        <[f64; 3]>::from(*vector).serialize(serializer)
    }

    /// Reads `[x, y, z]`.
    ///
    /// # Errors
    /// Errors of the deserializer: the value is not a list of three numbers.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vector3<f64>, D::Error> {
        <[f64; 3]>::deserialize(deserializer).map(Vector3::from)
    }
}

/// Representation of `Option<Vector3>`. Combine it with serde's `default` if the key may be absent.
pub mod optional_vector {
    use super::*;
    use nalgebra::Vector3;

    /// Writes `[x, y, z]`; `None` is written as the format's empty value, `null` in JSON.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<S: Serializer>(vector: &Option<Vector3<f64>>, serializer: S) -> Result<S::Ok, S::Error> {
        vector.map(<[f64; 3]>::from).serialize(serializer)
    }

    /// Reads `[x, y, z]`, or the format's empty value as `None`.
    ///
    /// # Errors
    /// Errors of the deserializer: the value is not a list of three numbers.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vector3<f64>>, D::Error> {
        Ok(Option::<[f64; 3]>::deserialize(deserializer)?.map(Vector3::from))
    }
}

/// Representation of `Vec<(String, T)>`: a table that keeps its order.
pub mod pairs {
    use super::*;

    /// Writes a table.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<T: Serialize, S: Serializer>(pairs: &[(String, T)], serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_map(Some(pairs.len()))?;
        for (key, value) in pairs {
            table.serialize_entry(key, value)?;
        }
        table.end()
    }

    /// Reads a table in its order. Repeated keys are kept, if the format allows them.
    ///
    /// # Errors
    /// Errors of the deserializer: the value is not a table, or a value in it is invalid.
    pub fn deserialize<'de, T, D>(deserializer: D) -> Result<Vec<(String, T)>, D::Error>
    where
        T: Deserialize<'de>,
        D: Deserializer<'de>,
    {
        deserializer.deserialize_map(Table(PhantomData))
    }

    struct Table<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Table<T> {
        type Value = Vec<(String, T)>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a table of names or patterns")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut pairs = Vec::new();
            while let Some(pair) = map.next_entry()? {
                pairs.push(pair);
            }
            Ok(pairs)
        }
    }
}

/// Representation of `Option<T>` for a value that is present by default: `false` removes it.
pub mod or_false {
    use super::*;
    use serde::de::IntoDeserializer;

    /// Writes the value, or `false`.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<T: Serialize, S: Serializer>(value: &Option<T>, serializer: S) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => value.serialize(serializer),
            None => serializer.serialize_bool(false),
        }
    }

    /// Reads a table or a number, or `false` as `None`.
    ///
    /// # Errors
    /// Errors of the deserializer: the value has another form (`true`, a list, a text), or is invalid.
    pub fn deserialize<'de, T, D>(deserializer: D) -> Result<Option<T>, D::Error>
    where
        T: Deserialize<'de>,
        D: Deserializer<'de>,
    {
        deserializer.deserialize_any(OrFalse(PhantomData))
    }

    struct OrFalse<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for OrFalse<T> {
        type Value = Option<T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a value, or false to disable it")
        }

        fn visit_bool<E: Error>(self, value: bool) -> Result<Self::Value, E> {
            if value { Err(E::invalid_value(serde::de::Unexpected::Bool(true), &self)) } else { Ok(None) }
        }

        fn visit_i64<E: Error>(self, value: i64) -> Result<Self::Value, E> {
            T::deserialize(value.into_deserializer()).map(Some)
        }

        fn visit_u64<E: Error>(self, value: u64) -> Result<Self::Value, E> {
            T::deserialize(value.into_deserializer()).map(Some)
        }

        fn visit_f64<E: Error>(self, value: f64) -> Result<Self::Value, E> {
            T::deserialize(value.into_deserializer()).map(Some)
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            T::deserialize(MapAccessDeserializer::new(map)).map(Some)
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Pose;
    use nalgebra::{UnitQuaternion, Vector3};
    use serde::{Deserialize, Serialize};
    use serde_json::from_str;

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    struct All {
        #[serde(with = "super::pose")]
        pose: Pose,
        #[serde(with = "super::rotation")]
        rotation: UnitQuaternion<f64>,
        #[serde(with = "super::vector")]
        vector: Vector3<f64>,
        #[serde(with = "super::optional_vector")]
        bias: Option<Vector3<f64>>,
        #[serde(with = "super::pairs")]
        pairs: Vec<(String, u8)>,
        #[serde(with = "super::or_false")]
        thickness: Option<f64>,
    }

    fn read(text: &str) -> All {
        from_str(text).unwrap()
    }

    #[test]
    fn round_trip() {
        for k in 0..100 {
            let angle = 0.1 + 0.37 * f64::from(k);
            let rotation = UnitQuaternion::from_euler_angles(angle, -0.3 * angle, 2.0);
            let all = All {
                pose: Pose::from_parts([angle, 0.1, -0.0].into(), rotation.inverse()),
                rotation,
                vector: Vector3::new(0.1, 0.2, angle),
                bias: (k % 2 == 0).then(Vector3::x),
                pairs: vec![("z.*".into(), 1), ("a".into(), 2)],
                thickness: (k % 3 == 0).then_some(angle),
            };
            // TOML, because serde_json reads numbers to the last digit but one.
            assert_eq!(toml::from_str::<All>(&toml::to_string(&all).unwrap()).unwrap(), all);
        }
    }

    #[test]
    fn forms_of_poses() {
        let turned =
            read(r#"{"pose": {"pos": [1, 2, 3], "rpy_deg": [0, 0, 90]}, "rotation": {"rpy_deg": [0, 0, 90]}}"#);
        let row = read(r#"{"pose": [1, 2, 3, 2, 0, 0, 2], "rotation": [3, 0, 0, 3]}"#);
        assert_eq!(turned.pose.translation, row.pose.translation);
        // The cosine of half the angle is known to 1e-16, the angle therefore to the square root of that.
        assert!(turned.pose.rotation.angle_to(&row.pose.rotation) < 1e-7);
        assert!((turned.rotation * Vector3::x() - Vector3::y()).norm() < 1e-15);
        assert!((row.rotation * Vector3::x() - Vector3::y()).norm() < 1e-15);
        let same = read(r#"{"pose": {"pos": [1, 2, 3], "quat_wxyz": [2, 0, 0, 2]}}"#);
        assert_eq!(same.pose, row.pose);
    }

    #[test]
    fn errors() {
        for (text, part) in [
            (r#"{"pose": [1, 2, 3]}"#, "array of length 7"),
            (
                r#"{"pose": [1, 2, 3, 0, 0, 0, 0]}"#,
                "is not a rotation: a quaternion w, x, y, z must be finite and not zero",
            ),
            (r#"{"pose": {"pos": [1, 2, 3], "rpy": [0, 0, 0]}}"#, "rpy_deg"),
            (r#"{"pose": {"quat_wxyz": [1, 0, 0, 0], "rpy_deg": [0, 0, 0]}}"#, "not both"),
            (r#"{"pose": 1}"#, "[x, y, z, qw, qx, qy, qz]"),
            (r#"{"rotation": [1, 0, 0]}"#, "array of length 4"),
            (r#"{"thickness": true}"#, "a value, or false to disable it"),
            (r#"{"pairs": [1]}"#, "a table of names"),
        ] {
            let message = from_str::<All>(text).unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
