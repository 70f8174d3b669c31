"""Questions of design: linear models, identification, balance, drives, flywheels."""
