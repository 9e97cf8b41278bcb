"""How a servo moves within one mode: closed forms, quadrature, series and steps."""
