"""The live branch: MQTT listener, watched folders, alarms."""
