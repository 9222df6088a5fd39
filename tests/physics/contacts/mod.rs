//! Contacts and sensors.
